"""Many browsers watching one console: what that costs, how late they see, and whether the arm notices.

`python -m bench.watchers` prints one table. The cell is that of `dipac run` with its cameras, a plan is up for
approval, so that its ghost moves twelve times a second, and the arm moves. The browsers are websockets in a process of
their own that read all they are sent; how late they see is from the moment a line is shown to its arrival there.
"""

import multiprocessing
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import Final, NamedTuple

import aiohttp
import anyio
import numpy as np
import psutil
import viser
import zstandard
from rich.console import Console as TerminalOutput
from rich.table import Table
from yarl import URL

from app.config import Site
from app.core.messages import Frame, Notice, Particles, Proposal, fresh_id
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.tasks import load
from app.ui.console import Console, open_console
from bench.approval import approved, offered
from bench.arm import across

_WATCHERS: Final = (0, 1, 8)
_MOTIONS: Final = 4
_LINES: Final = 40
_LINE_EVERY_S: Final = 0.4
_MARK: Final = "line number "
_HEADER_BYTES: Final = 16
"""Length of the header of viser's packed message: its sizes, unpacked and packed."""
_SITE = Site()
_SEEN = np.zeros((1, 3), np.float32)


@dataclass(kw_only=True)
class Heard:
    """Traffic to the browsers: lines that came to one of them with their times [s], and the bytes to all."""

    lines_s: list[tuple[int, float]] = field(default_factory=list[tuple[int, float]])
    count: int = 0


class Seen(NamedTuple):
    """Cost of watchers: the application's share of a core, megabytes a second, delays [s], periods [ms]."""

    share: float
    mb_s: float
    delays_s: Sequence[float]
    periods_ms: np.ndarray


def main() -> None:
    """Print the table."""
    times = ("seen after, p50 / p99, ms", "arm's period, p99 / max, ms")
    table = Table("browsers", "application, % of a core", "MB/s to all", "lines seen", *times)
    for count in _WATCHERS:
        seen = anyio.run(_watched, count)
        delays_ms = 1e3 * np.array(seen.delays_s) if len(seen.delays_s) else np.full(1, np.nan)
        table.add_row(
            str(count),
            f"{100 * seen.share:.0f}",
            f"{seen.mb_s:.2f}",
            f"{len(seen.delays_s)} of {count * _LINES}",
            f"{np.median(delays_ms):.0f} / {np.percentile(delays_ms, 99):.0f}" if count else "",
            f"{np.percentile(seen.periods_ms, 99):.1f} / {seen.periods_ms.max():.1f}",
        )
    TerminalOutput().print(table)


async def _watched(count: int) -> Seen:
    task = load("rope_push")
    async with (
        simulated_rig(stage=task.stage, start=task.start(0), site=_SITE, seed=0) as rig,
        open_console(host="127.0.0.1", port=0, title="bench", cell="simulated", stop=rig.arm.stop) as console,
    ):
        ours, theirs = multiprocessing.get_context("spawn").Pipe()
        watching = multiprocessing.get_context("spawn").Process(target=_watch, args=(console.url, count, theirs))
        watching.start()
        await anyio.to_thread.run_sync(ours.recv)
        periods, said_s = list[np.ndarray](), dict[int, float]()
        process, began_s = psutil.Process(), time.monotonic()
        spent = process.cpu_times()
        async with anyio.create_task_group() as showing:
            showing.start_soon(_show_all, console, rig)
            async with anyio.create_task_group() as both:
                both.start_soon(_say_lines, console, said_s)
                for _ in range(_MOTIONS):
                    executed = await rig.arm.execute(approved(across(0.1), _SEEN))
                    periods.append(np.diff(executed.times_s) * 1e3)
            showing.cancel_scope.cancel()
        after, took_s = process.cpu_times(), time.monotonic() - began_s
        ours.send("end")
        heard: Heard = await anyio.to_thread.run_sync(ours.recv)
        watching.join()
    return Seen(
        (after.user + after.system - spent.user - spent.system) / took_s,
        heard.count / 1e6 / took_s,
        [at_s - said_s[line] for line, at_s in heard.lines_s if line in said_s],
        np.concatenate(periods),
    )


async def _show_all(console: Console, rig: SimulatedRig) -> None:
    """Show the messages of the running program: images, particles, the arm's state, and a plan that waits."""
    task = load("rope_push")
    x = task.goal(0, 300)
    proposal = _proposal(x)
    console.show(proposal)
    while True:
        for camera in rig.cameras:
            frame: Frame = await camera.read()
            console.show(frame)
        now_s = time.monotonic()
        console.show(Particles(id=fresh_id("particles"), time_s=now_s, positions=x, surface=x, reconstruction_s=0.05))
        console.show(await rig.arm.state())


def _proposal(x: np.ndarray) -> Proposal:
    """A plan of eight branches."""
    plan = offered(across(0.1), x)
    branches = tuple(replace(plan.chosen, cost_after=0.5 + 0.01 * index) for index in range(8))
    return replace(plan, time_s=time.monotonic(), branches=branches)


async def _say_lines(console: Console, said_s: dict[int, float]) -> None:
    for line in range(_LINES):
        said_s[line] = time.monotonic()
        console.show(Notice(id=fresh_id("notice"), time_s=said_s[line], where="bench", text=f"{_MARK}{line}."))
        await anyio.sleep(_LINE_EVERY_S)


def _watch(url: str, count: int, pipe: "Connection[object, object]") -> None:
    """Process of the browsers: it reads until told to end, and reports the time of each line at each of them."""
    pipe.send(anyio.run(_join, url, count, pipe))


async def _join(url: str, count: int, pipe: "Connection[object, object]") -> Heard:
    heard = Heard()
    origin = str(URL(url).origin())
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
        async with browser.get(url) as entered:
            entered.raise_for_status()
        async with anyio.create_task_group() as all_of_them:
            for _ in range(count):
                all_of_them.start_soon(_read, browser, origin, heard)
            await anyio.sleep(2.0)
            heard.count = 0  # The whole scene, which each of them got first.
            pipe.send("ready")
            await anyio.to_thread.run_sync(pipe.recv)
            all_of_them.cancel_scope.cancel()
    return heard


async def _read(browser: aiohttp.ClientSession, origin: str, heard: Heard) -> None:
    known, unpack = -1, zstandard.ZstdDecompressor()
    protocol, headers = f"viser-v{viser.__version__}", {"Origin": origin}
    async with browser.ws_connect(origin, protocols=[protocol], headers=headers, max_msg_size=0) as websocket:
        async for message in websocket:
            heard.count += len(message.data)
            size = int.from_bytes(message.data[8:_HEADER_BYTES], "little")
            text = unpack.decompress(message.data[_HEADER_BYTES : _HEADER_BYTES + size])
            while f"{_MARK}{known + 1}.".encode() in text:
                known += 1
                heard.lines_s.append((known, time.monotonic()))


if __name__ == "__main__":
    main()
