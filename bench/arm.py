"""The arm while the planner keeps the machine busy: control periods, and from the press of STOP to rest.

`python -m bench.arm` prints one table. STOP is pressed as a browser presses it, by a POST to the console's server, and
the time counts from before the request leaves. The planner is that of `dipac run`, deciding again and again.
"""

import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import final
from urllib.parse import urlsplit

import aiohttp
import anyio
import numpy as np
from anyio.abc import TaskStatus
from rich.console import Console as TerminalOutput
from rich.table import Table

from app.commands._episode import PLANNER_NICENESS
from app.config import Site
from app.core.messages import Executed
from app.core.motion import Motion
from app.core.system.worker import Worker
from app.jobs.worker_api import nominal_model, plan, warm_up_stage, warm_up_stages
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.tasks import Task, load
from app.ui.console import open_console
from bench.approval import approved

_STOPS = 40
_PERIOD_MOTIONS = 6
_POLL_S = 0.01
_AT_REST_M_S = 2e-3
_SITE = Site()
_SEEN = np.zeros((1, 3), np.float32)
"""Particles shown for approval of these motions: none of a rope."""


@final
class Cell:
    """A rig, and the STOP button of its console."""

    def __init__(self, rig: SimulatedRig, browser: aiohttp.ClientSession, url: str) -> None:
        self.rig = rig
        self._browser = browser
        self._origin = f"http://{urlsplit(url).netloc}"

    async def press_stop(self) -> float:
        """Press it; when the request was sent [s]."""
        pressed_s = time.monotonic()
        async with self._browser.post(f"{self._origin}/stop", headers={"Origin": self._origin}) as reply:
            assert (await reply.json())["stopped"]
        return pressed_s


def main() -> None:
    """Print the table."""
    TerminalOutput().print(anyio.run(_table))


async def _table() -> Table:
    task = load("rope_push")
    table = Table("measured", "planner idle", "planner busy", title="The arm's process [ms]")
    decided: list[float] = []
    idle = busy = ("", "")
    async with _cell(task) as cell:
        idle = (await _periods(cell), await _stops(cell))
        async with Worker("planner", niceness=PLANNER_NICENESS) as planner, anyio.create_task_group() as others:
            await others.start(_decide, planner, task, decided)
            busy = (await _periods(cell), await _stops(cell))
            others.cancel_scope.cancel()
    for name, free, loaded in zip(("control period", f"STOP to rest, n = {_STOPS}"), idle, busy, strict=True):
        table.add_row(name, free, loaded)
    table.caption = f"{len(decided)} decisions were made meanwhile, in a median of {np.median(decided):.1f} s."
    return table


@asynccontextmanager
async def _cell(task: Task) -> AsyncGenerator[Cell]:
    async with (
        simulated_rig(stage=task.stage, start=task.start(0), site=_SITE, seed=0) as rig,
        open_console(host="127.0.0.1", port=0, title="bench", cell="simulated", stop=rig.arm.stop) as console,
        aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser,
    ):
        async with browser.get(console.url) as entered:  # Leaves the cookie that STOP needs.
            entered.raise_for_status()
        yield Cell(rig, browser, console.url)


async def _decide(
    planner: Worker, task: Task, decided: list[float], *, task_status: TaskStatus[None] = anyio.TASK_STATUS_IGNORED
) -> None:
    """Plan without end, once everything is compiled."""
    particle_count = task.preset("cpu").particle_count
    model = nominal_model(task.name)
    for index, _ in enumerate(await planner.run(warm_up_stages, task.name, "cpu")):
        await planner.run(warm_up_stage, task.name, "cpu", index)
    task_status.started()
    while True:
        began_s = time.monotonic()
        x, goal = task.goal(len(decided) + 100, particle_count), task.goal(len(decided), particle_count)
        await planner.run(plan, task.name, "cpu", x, goal, model, len(decided), _SITE)
        decided.append(time.monotonic() - began_s)


async def _periods(cell: Cell) -> str:
    """The times between the states that the arm logged during motions."""
    periods = np.concatenate([await _periods_of_one(cell) for _ in range(_PERIOD_MOTIONS)])
    return f"p50 {np.median(periods):.1f}, p99 {np.percentile(periods, 99):.1f}, longest {periods.max():.1f}"


async def _periods_of_one(cell: Cell) -> np.ndarray:
    executed = await cell.rig.arm.execute(approved(across(0.1), _SEEN))
    assert executed.outcome == "completed", executed.reason
    return np.diff(executed.times_s) * 1e3


async def _stops(cell: Cell) -> str:
    """Times from the press of STOP to the first logged state at rest, at the full speed of the arm, as text."""
    taken_ms: list[float] = []
    for _ in range(_STOPS):
        pressed_s, executed = await _stopped(cell, across(_SITE.limits.speed_m_s))
        speed = np.linalg.norm(np.diff(executed.measured[:, :3], axis=0), axis=1) / np.diff(executed.times_s)
        at_rest = executed.times_s[1:][(speed < _AT_REST_M_S) & (executed.times_s[1:] > pressed_s)]
        taken_ms.append((at_rest[0] - pressed_s) * 1e3)
        await cell.rig.arm.reset(asked_s=time.monotonic())
    return f"median {np.median(taken_ms):.0f}, longest {max(taken_ms):.0f}"


async def _stopped(cell: Cell, motion: Motion) -> tuple[float, Executed]:
    """Execute `motion` and press STOP once it runs at its full speed: when that was, and what was done."""
    pressed_s = 0.0

    async def press() -> None:
        nonlocal pressed_s
        while pressed_s == 0:
            await anyio.sleep(_POLL_S)
            if np.linalg.norm((await cell.rig.arm.state()).velocity[:2]) > motion.speeds[0] * 0.95:
                pressed_s = await cell.press_stop()

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(press)
        executed = await cell.rig.arm.execute(approved(motion, _SEEN))
        assert executed.outcome == "stopped", executed.reason
        return pressed_s, executed
    raise AssertionError("the task group ends with its body")


def across(speed_m_s: float) -> Motion:
    """Motion from one side of the table to the other, above the rope."""
    return Motion(positions=np.array([[0.4, -0.25, 0.05], [0.4, 0.25, 0.05]]), speeds=np.full(2, speed_m_s))


if __name__ == "__main__":
    main()
