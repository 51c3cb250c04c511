"""A recording before the console's controller, without a browser: jumps, playing on, and what was planned again."""

from collections.abc import Callable
from pathlib import Path

import anyio
import pytest

from app.commands._player import reel, show
from app.core.dialogue.requests import Request
from app.core.system.channel import Lossless
from app.recording.read.timeline import open_timeline
from app.ui.console import Console
from app.ui.parts.operator_controller import OperatorController
from app.ui.player import FASTEST, Player
from app.ui.replanning import Replanned, ReplanRequest
from tests.ui import synthetic
from tests.ui.film import film

AGAIN = synthetic.proposal(synthetic.rope(0.3), seed=8, branches=4)


async def planned(order: ReplanRequest, said: Callable[[str], None]) -> Replanned:
    said("Compiling nothing.")
    return Replanned(then=None, again=AGAIN, model=order.model)


async def until(holds: Callable[[], bool]) -> None:
    for _ in range(1500):
        if holds():
            return
        await anyio.sleep(0.02)
    raise AssertionError("It did not come about in 30 s.")


@pytest.mark.anyio
async def test_the_desk_follows_the_player(tmp_path: Path) -> None:
    path = await anyio.to_thread.run_sync(film, tmp_path)
    opening = open_timeline(path)
    timeline = await anyio.to_thread.run_sync(opening.__enter__)
    player = Player(reel(timeline))
    requests = Lossless[Request]("operator requests", bound=10)
    controller = OperatorController(stop=lambda: None, post=requests.put_nowait, now=player.now, replay=True)
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(show, player, timeline, Console(url="", controller=controller, requests=requests), planned)
        player.jump(3.0)
        await until(lambda: controller.state.pending is not None)
        assert not controller.state.decidable
        assert controller.state.pending is not None
        assert controller.now() == pytest.approx(controller.state.pending.time_s, abs=1e-3)

        player.order(ReplanRequest(time_s=3.0))
        await until(lambda: controller.state.shown is AGAIN)
        assert player.replanned is not None
        player.set_speed(FASTEST)
        player.toggle()
        await until(lambda: len(controller.state.outcomes) == 3)
        await until(lambda: not player.where.playing)
        assert controller.state.executed is not None

        player.jump(0.0)
        await until(lambda: controller.state.shown is None)
        assert controller.state.outcomes == ()
        tasks.cancel_scope.cancel()
    await anyio.to_thread.run_sync(opening.__exit__, None, None, None)
