"""A recording before the console: time goes on, jumps are followed, moments are planned again."""

import time
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import ExitStack, asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Protocol, TypeAlias

import anyio
from anyio import to_thread
from rich.table import Table
from rich.text import Text

from app.commands._preflight import check_port
from app.commands._progress import print_whole
from app.commands._replan import model_names, replan
from app.config import Site
from app.core.errors import DipacError, ParameterError, RecordingError, UsageError
from app.core.geometry.scene_description import Stage
from app.core.messages import Fault, Message, fresh_id
from app.core.system.worker import Worker
from app.recording.read.timeline import Timeline, open_timeline
from app.tasks import load
from app.ui.console import Console, open_console
from app.ui.player import FASTEST, Player, Reel
from app.ui.replanning import Replanned, ReplanRequest, rows
from app.ui.terminal import Output

_NICENESS = 10
"""The planner gives way to the console."""
_PERIOD_S = 1 / 15
_ASKED_PERIOD_S = 0.1

Plan: TypeAlias = Callable[[ReplanRequest, Callable[[str], None]], Awaitable[Replanned]]
"""Function that makes the plan of an order, and reports progress."""


class Playable(Protocol):
    """Interface of a recording that a player needs; see `Timeline`."""

    def at(self, time_s: float) -> list[Message]:
        """Messages that give the whole state at that time."""
        ...

    def gist(self, after_s: float, until_s: float) -> list[Message]:
        """Messages since that still matter."""
        ...


async def serve(file: Path, output: Output, *, at_s: float, speed: float, model: str, port: int) -> None:
    """Serve the recording `file` in the console until cancelled. Raises as `open_timeline` and `open_console`."""
    site = Site(console_port=port)
    check_port(site)
    async with Worker("planner", niceness=_NICENESS) as planner, _open_recording(file, output) as timeline:
        player = Player(reel(timeline), time_s=at_s, speed=speed, model=model)
        async with open_console(
            host=site.console_host,
            port=site.console_port,
            title=f"dipac {file.name}",
            cell="replay",
            stop=lambda: None,
            limits=site.limits,
            stage=await to_thread.run_sync(_stage_of, timeline),
            player=player,
        ) as console:
            output.print(Text.assemble("Operator console: ", (console.url, "bold"), no_wrap=True), soft_wrap=True)
            await show(player, timeline, console, partial(replan, planner, timeline))


async def compare(file: Path, output: Output, *, at_s: float, model: str) -> None:
    """Plan the moment `at_s` [s] of `file` again and print how it compares. Raises as `replanned`."""
    async with Worker("planner", niceness=_NICENESS) as planner, _open_recording(file, output) as timeline:
        if at_s > timeline.duration_s:
            raise ParameterError(
                f"--at = {at_s:g} is after the end of {file}, which is {timeline.duration_s:.2f} s long."
            )
        with output.status("planning") as status:
            found = await replan(planner, timeline, ReplanRequest(time_s=at_s, path=model), status.update)
    table = Table("", "then", "planned again")
    for row in rows(found):
        table.add_row(*row)
    output.print(Text(f"{file}, {at_s:.2f} s, planned again in {found.again.plan_s:.1f} s"), soft_wrap=True)
    print_whole(output, table)


@asynccontextmanager
async def _open_recording(file: Path, output: Output) -> AsyncGenerator[Timeline]:
    """Open the recording's timeline; the terminal shows progress of reading it."""
    with ExitStack() as stack:
        with output.status(f"reading {file.name}") as status:

            def told(share: float) -> None:
                status.update(Text(f"reading {file.name}: {share:.0%}"))

            timeline = await to_thread.run_sync(stack.enter_context, open_timeline(file, told))
        yield timeline


def _stage_of(timeline: Timeline) -> Stage | None:
    """The task's stage at the recording's beginning; None of a task that this program does not have."""
    try:
        return load(timeline.episode(0.0).task).stage
    except (UsageError, RecordingError):
        return None


def reel(timeline: Timeline) -> Reel:
    """The recording as the player sees it."""
    return Reel(
        name=timeline.path.name,
        duration_s=timeline.duration_s,
        marks=timeline.marks,
        models=tuple(model_names(timeline)),
        clock=timeline.clock,
    )


async def show(player: Player, film: Playable, console: Console, plan: Plan) -> None:
    """Show the player's position, and serve its requests, for ever."""
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(_play, player, film, console)
        tasks.start_soon(_plan_again, player, plan)
        tasks.start_soon(_listen, console)


async def _play(player: Player, film: Playable, console: Console) -> None:
    shown_s, last_s = 0.0, time.monotonic()
    while True:
        now_s = time.monotonic()
        where = player.advance(now_s - last_s)
        last_s = now_s
        try:
            if where.jumped:
                console.reset([*await to_thread.run_sync(film.at, where.time_s), *where.besides])
            elif where.time_s > shown_s:
                for message in await to_thread.run_sync(film.gist, shown_s, where.time_s):
                    console.show(message)
        except RecordingError as error:
            player.pause()
            console.show(Fault(id=fresh_id("fault"), time_s=player.now(), where="replay", text=str(error)))
        shown_s = where.time_s
        hurried = where.playing and where.speed == FASTEST
        await anyio.sleep(0.0 if hurried else _PERIOD_S)


async def _plan_again(player: Player, plan: Plan) -> None:
    """Plan one order after the other; failures are reported to the operator who asked."""
    while True:
        order = player.pending_request()
        if order is None:
            await anyio.sleep(_ASKED_PERIOD_S)
            continue
        try:
            found = await plan(order, player.tell)
        except DipacError as error:
            player.answer(str(error))
        else:
            player.answer(f"Planned in {found.again.plan_s:.1f} s. Playing on shows what was recorded.", found)


async def _listen(console: Console) -> None:
    """Show the console's messages about itself, such as rejected operators; it may request nothing else."""
    async for message in console.requests():
        console.show(message)
