"""From a page's websocket to an arm that moves: the parts as the program joins them."""

import anyio
import numpy as np
import pytest

from app.config import Site
from app.core.messages import Executed
from app.teleop import Pilot
from tests.session.rig import TickedArm
from tests.ui import synthetic
from tests.ui.test_console import opened
from tests.ui.test_hostile import lease, line, page, sample, told

pytestmark = pytest.mark.anyio

AIM = [0.33, 0.04, 0.28]


async def test_what_a_page_holds_moves_the_arm_while_the_program_waits_for_it_and_not_before() -> None:
    arm, stretches = TickedArm(Site()), list[Executed]()
    pilot = Pilot(jog=arm.jog, tool=arm.tool, limits=Site().limits)
    async with opened(hand=pilot) as it, page(it) as (key, _), line(it) as hand:
        it.console.show(synthetic.mode("teleoperate"))
        it.console.show(lease("client 0"))
        await hand.send_str(key)
        sequence = 0

        async def held(pressed: int, count: int, **more: object) -> set[str]:
            """Answers to so many samples."""
            nonlocal sequence
            answers = set[str]()
            for _ in range(count):
                sequence += 1
                await hand.send_json(sample(sequence, pressed=pressed, **more))
                answers.add(await told(hand))
                await anyio.sleep(1 / 30)
            return answers

        async def wait() -> None:
            stretches.append(await arm.accept_jogs())

        (busy,) = await held(1, 5, axes={"y": 1})
        assert "busy with something else" in busy
        home = arm.tool()
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(wait)
            await anyio.sleep(0.05)
            assert await held(1, 5, axes={"y": 1}) == {busy}, "a press that began before does not count"
            assert np.array_equal(arm.tool(), home)
            answers = set[str]()
            with anyio.fail_after(30):  # A process that is late moves it slower.
                while arm.tool()[1] < home[1] + 0.02:
                    answers |= await held(2, 1, axes={"y": 1}, speed=0.3)
            assert "moving" in answers
            await anyio.sleep(0.2)
            (again,) = await held(2, 5, axes={"y": 1})
            assert "press again" in again
        assert stretches[0].outcome == "completed"
        assert 0.02 < arm.tool()[1] < 0.08
        assert stretches[0].measured[-1, 1] == pytest.approx(arm.tool()[1], abs=1e-3)

        pilot.aim(np.array(AIM))
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(wait)
            await anyio.sleep(0.05)
            assert "there" in await held(3, 90, towards=True)
            await held(3, 1, held=False)
        assert arm.tool()[:3] == pytest.approx(AIM, abs=2e-3)

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(wait)
            await anyio.sleep(0.05)
            await held(4, 10)
            async with it.browser.post(f"{it.origin}/stop", headers={"Origin": it.origin}) as reply:
                assert reply.status == 200
            arm.stop()
            assert await held(4, 3) == {"a stop is in force: press Resume"}
        assert stretches[-1].outcome == "stopped"
