"""The whole application for a long time: memory, drops, and the arm's period. `python -m bench.soak [MINUTES] [RIG]`.

Motions are made automatically, towards a new goal whenever one is reached, on the rig of that name (the rehearsal where
none is given). Where the arm was stopped it is resumed, as by an operator, and counted. The memory is what each process
has for itself (USS), so what they share counts for none.
"""

import sys
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import final

import anyio
import numpy as np
import psutil
from anyio import to_thread
from rich.console import Console
from rich.table import Table

from app import cells
from app.cells.base import Wanted
from app.config import Site
from app.core.dialogue.control import Mode, ModeRequest
from app.core.dialogue.requests import GoalRequest, Request
from app.core.messages import ArmState, Episode, Executed, Fault, Goal, Health, Message, ResumeRequest, fresh_id
from app.core.system.clock import SystemClock
from app.core.system.worker import Worker
from app.recording.library.session_recorder import open_studio
from app.recording.read.reader import read_messages
from app.recording.write.preflight import Room
from app.session import Parts, Session
from app.tasks import Task, load
from app.tasks.elements.base import EpisodeConfig

_MINUTES, _RIG, _TASK, _PRESET = 10.0, "rehearsal", "rope_push", "cpu"
_SAMPLE_S = 10.0
_GOAL_EVERY_S = 90.0
_RESUMES_S = 2.0
_SETTLED = 0.25
"""The first part of the time, in which caches fill, does not count for the growth."""
_MANY, _AT_ONCE = 10_000, 1000
"""Motions: in all, and asked for with each goal."""
_ROOM = Room(min_free_bytes=1_000_000_000, expected_bytes=1_000_000_000, budget_bytes=None)


@final
@dataclass(kw_only=True)
class Soaked:
    """Measurements on the way. `memory`: by process, (time [s], bytes) again and again."""

    memory: dict[str, list[tuple[float, float]]] = field(default_factory=dict[str, list[tuple[float, float]]])
    longest_period_s: list[float] = field(default_factory=list[float])
    periods_s: list[np.ndarray] = field(default_factory=list[np.ndarray])
    drops: dict[str, int] = field(default_factory=dict[str, int])
    faults: list[str] = field(default_factory=list[str])
    motions: int = 0
    stops: list[str] = field(default_factory=list[str])


@final
class Somebody:
    """An operator who wants one goal after the other, and all motions made automatically, also after a stop."""

    def __init__(self, task: Task, soaked: Soaked) -> None:
        self._task, self._soaked = task, soaked
        self._aimed, self._stopped, self._idle = anyio.Event(), anyio.Event(), anyio.Event()

    def show(self, message: Message) -> None:
        """Note what counts."""
        match message:
            case ArmState(period_s=period_s):
                self._soaked.longest_period_s.append(period_s)
            case Executed(times_s=times_s, outcome=outcome, reason=reason):
                self._soaked.motions += 1
                self._soaked.periods_s.append(np.diff(times_s))
                if outcome != "completed":
                    self._soaked.stops.append(reason)
                    self._stopped.set()
                    self._idle.set()
            case Goal():
                self._aimed.set()
            case Mode(mode="idle"):
                self._idle.set()
            case Health(drops=drops):
                self._soaked.drops = dict(drops)
            case Fault(text=text):
                self._soaked.faults.append(text)
            case _:
                pass

    async def requests(self) -> AsyncIterator[Request]:
        """A goal after the other, and automatic motions."""
        count, seed = self._task.preset(_PRESET).particle_count, 1
        while True:
            goal = await to_thread.run_sync(self._task.goal, seed, count)
            now_s, self._aimed = time.monotonic(), anyio.Event()
            yield GoalRequest(
                id=fresh_id("goal request"), time_s=now_s, operator="soak", source="region", positions=goal
            )
            with anyio.move_on_after(_GOAL_EVERY_S):
                await self._aimed.wait()
            now_s, self._idle = time.monotonic(), anyio.Event()
            yield ModeRequest(
                id=fresh_id("mode request"), time_s=now_s, operator="soak", mode="automatic", motions=_AT_ONCE
            )
            with anyio.move_on_after(_GOAL_EVERY_S):
                await self._idle.wait()
            if self._stopped.is_set():
                await anyio.sleep(_RESUMES_S)
                self._stopped = anyio.Event()
                yield ResumeRequest(id=fresh_id("resume request"), time_s=time.monotonic(), operator="soak")
            seed += 1


async def soak(minutes: float, rig_name: str, folder: Path) -> tuple[Soaked, int, int]:
    """Measurements, and the numbers of messages published and recorded."""
    task, soaked = load(_TASK), Soaked()
    cell = await to_thread.run_sync(cells.load, rig_name)
    # As a command does it: what the arm of this cell does not reach is not to be planned.
    site = cell.narrowed(Site(recordings=folder), None)
    start = Episode(
        id=fresh_id("episode"),
        time_s=time.monotonic(),
        task=task.name,
        rig=rig_name,
        seed=0,
        simulated=cell.simulated,
        code_version="soak",
        config="{}",
    )
    count = task.preset(_PRESET).particle_count
    goal = Goal(id=fresh_id("goal"), time_s=time.monotonic(), positions=await to_thread.run_sync(task.goal, 0, count))
    config = EpisodeConfig(
        task=task,
        preset=_PRESET,
        goal=goal,
        model=None,
        seed=0,
        pushes=_MANY,
        automatic=True,
        calibrating=True,
        staying=True,
    )
    wanted = Wanted(stage=task.stage, start=task.start(0), site=site, seed=0)
    async with (
        Worker("planner", niceness=10) as planner,
        cell.open(wanted) as rig,
        open_studio(folder, start, _ROOM) as recorder,
    ):
        session = Session(
            Parts(
                config,
                site=site,
                rig=rig,
                operator=Somebody(task, soaked),
                recorder=recorder,
                clock=SystemClock(),
                planner=planner,
                recording=recorder.path,
                studio=recorder,
            )
        )
        with anyio.move_on_after(60.0 * minutes):
            async with anyio.create_task_group() as tasks:
                tasks.start_soon(session.run)
                tasks.start_soon(_weigh, soaked)
    kept = await to_thread.run_sync(lambda: sum(1 for _ in read_messages(recorder.path)))
    return soaked, session.summary.said, kept


async def _weigh(soaked: Soaked) -> None:
    """Note the memory of every process of the application, again and again."""
    while True:
        await anyio.sleep(_SAMPLE_S)
        for name, size in (await to_thread.run_sync(_sizes)).items():
            soaked.memory.setdefault(name, []).append((time.monotonic(), size))


def _sizes() -> dict[str, float]:
    """Memory [bytes] by process."""
    own, sizes = psutil.Process(), dict[str, float]()
    for process in (own, *own.children(recursive=True)):
        try:
            name = "application" if process == own else f"{process.pid}"
            sizes[name] = float(process.memory_full_info().uss)
        except psutil.Error:
            continue
    return sizes


def growth(samples: Sequence[tuple[float, float]]) -> float:
    """Relative growth of the memory after settling, by a straight line."""
    rows = np.array(samples)[int(_SETTLED * len(samples)) :]
    slope, middle = np.polyfit(rows[:, 0] - rows[0, 0], rows[:, 1], 1)
    return float(slope * (rows[-1, 0] - rows[0, 0]) / middle)


def total(soaked: Soaked) -> list[tuple[float, float]]:
    """The memory of all processes that were there from the first sample to the last."""
    count = max(map(len, soaked.memory.values()))
    whole = [rows for rows in soaked.memory.values() if len(rows) == count]
    return [(rows[0][0], sum(row[1] for row in rows)) for rows in zip(*whole, strict=True)]


def tenths(soaked: Soaked) -> list[float]:
    """The application's own memory at the end of each tenth of the time [bytes]."""
    sizes = [size for _, size in soaked.memory["application"]]
    return [sizes[round(part * (len(sizes) - 1) / 10)] for part in range(1, 11)]


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    minutes = float(arguments[0]) if arguments else _MINUTES
    rig = arguments[1] if len(arguments) > 1 else _RIG
    with TemporaryDirectory() as folder:
        soaked, said, kept = anyio.run(soak, minutes, rig, Path(folder))
    periods_ms = 1e3 * np.concatenate(soaked.periods_s)
    memory = total(soaked)
    table = Table(f"{minutes:g} minutes on the {rig} rig", "")
    table.add_row("motions", str(soaked.motions))
    table.add_row("of these stopped, and resumed", "; ".join(soaked.stops) or "none")
    table.add_row("memory at the end, all processes", f"{memory[-1][1] / 1e6:.0f} MB")
    table.add_row(f"its growth after the first {_SETTLED:.0%}", f"{growth(memory):+.1%}")
    table.add_row("the application's own", f"{growth(soaked.memory['application']):+.1%}")
    table.add_row("in each tenth of the time", " ".join(f"{size / 1e6:.0f}" for size in tenths(soaked)) + " MB")
    table.add_row("arm's period, p99 / longest", f"{np.percentile(periods_ms, 99):.1f} / {periods_ms.max():.1f} ms")
    table.add_row("messages said, in the recording", f"{said}, {kept}")
    table.add_row("newest counts alone: not read", ", ".join(f"{name} {count}" for name, count in soaked.drops.items()))
    table.add_row("faults", "; ".join(soaked.faults) or "none")
    Console().print(table)


if __name__ == "__main__":
    main(sys.argv[1:])
