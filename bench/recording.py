"""Cost of recording, and losses by a kill: `python -m bench.recording`."""

import multiprocessing
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import final

import anyio
import msgspec
import numpy as np
from mcap.reader import make_reader
from rich.console import Console
from rich.table import Table

from app.core.geometry.camera import CameraModel
from app.core.messages import Episode, Executed, Frame, Goal, Message, Notice, Particles, fresh_id
from app.recording.format.codec import encode
from app.recording.library.clip import Cut, write_clip
from app.recording.library.recover import recover
from app.recording.read.reader import read_messages
from app.recording.write.file import EpisodeFile
from app.recording.write.preflight import Room
from app.recording.write.writer import open_recording

_REPEATS = 50
_RATE_HZ = 30.0
_LOOK_HZ = 4.0
"""Rate of the cameras while the program plans and pushes."""


@final
@dataclass(frozen=True, kw_only=True)
class Kill:
    """Loss by one SIGKILL: the age [s] of the last message that survived, and the number lost after it.

    `readable`: the MCAP package reads all that was recovered.
    """

    age_s: float
    messages: int
    lost_bytes: int
    readable: bool


@final
@dataclass(frozen=True, kw_only=True)
class Load:
    """Cost of recording: share of one core, times of `write` [s], messages lost, and the longest queue."""

    share: float
    p50_s: float
    p99_s: float
    longest_s: float
    lost: int
    peak: int
    mb: float


def main(kills: int = 20) -> None:
    """Print the cost of each large message, of arrays in JSON, of recording under load, and what kills took."""
    terminal = Console()
    with tempfile.TemporaryDirectory() as folder:
        costs = Table("message", "CPU ms", "file kB")
        for message in samples():
            cpu_ms, kb = cost(Path(folder), message)
            costs.add_row(type(message).__name__, f"{cpu_ms:.2f}", f"{kb:.1f}")
        terminal.print(costs)
        terminal.print(
            "An array of 34 clouds of 300 points in JSON: {:.2f} ms as lists, {:.2f} ms packed.".format(*arrays())
        )
        load = sustain(Path(folder))
        terminal.print(
            f"Two cameras of 640x480 at {_RATE_HZ:.0f} Hz with particles, 10 s: {load.share:.0%} of one core, "
            f"{load.mb:.0f} MB, {load.lost} messages lost, {load.peak} waiting at most; a write takes "
            f"{1e3 * load.p50_s:.1f} ms (median), {1e3 * load.p99_s:.1f} ms (p99), "
            f"{1e3 * load.longest_s:.1f} ms at most."
        )
        cut_s, session_mb, clip_mb = clip(Path(folder))
        terminal.print(f"A clip of {clip_mb:.0f} MB out of a session of {session_mb:.0f} MB takes {cut_s:.1f} s.")
    context, rng = multiprocessing.get_context("spawn"), np.random.default_rng(0)
    taken = [kill(context, after_s=float(rng.uniform(0.5, 6.0))) for _ in range(kills)]
    ages = sorted(it.age_s for it in taken)
    terminal.print(
        f"{kills} kills under that load at random moments: the newest message left was {ages[len(ages) // 2]:.3f} s "
        f"old (median), {ages[-1]:.3f} s at worst; at most {max(it.messages for it in taken)} notices of "
        f"{_RATE_HZ:.0f} a second were missing, {max(it.lost_bytes for it in taken)} bytes made no sense; read by the "
        f"plain MCAP reader after recovery: {sum(it.readable for it in taken)} of {kills}."
    )


def samples() -> Sequence[Message]:
    """Messages of the sizes that the rope task makes, with noise like a camera's."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3)).astype(np.float32)
    poses = rng.normal(size=(400, 7))
    return [
        frame(rng),
        Particles(
            id=fresh_id("particles"),
            time_s=0.0,
            positions=points,
            surface=rng.normal(size=(6000, 3)).astype(np.float32),
            reconstruction_s=0.05,
        ),
        Goal(id=fresh_id("goal"), time_s=0.0, positions=points),
        Executed(
            id=fresh_id("executed"),
            time_s=0.0,
            approved_id=fresh_id("approved"),
            outcome="completed",
            reason="",
            times_s=np.arange(400) * 0.01,
            commanded=poses,
            measured=poses,
        ),
        notice(0),
    ]


def frame(rng: np.random.Generator) -> Frame:
    """640x480, a ramp of colour and waves of depth with noise."""
    waves = 700 + 50 * np.sin(np.linspace(0, 9, 640))[None] + rng.normal(0, 1.5, (480, 640))
    ramp = np.linspace(60, 180, 640)[None, :, None] + rng.normal(0, 4, (480, 640, 3))
    camera = CameraModel(name="left", width=640, height=480, K=np.eye(3), T_world_camera=np.eye(4), depth_unit_m=1e-3)
    return Frame(
        id=fresh_id("frame"), time_s=0.0, camera=camera, color=ramp.astype(np.uint8), depth=waves.astype(np.uint16)
    )


def notice(count: int) -> Notice:
    """A small message that carries its number and the moment of its making."""
    return Notice(id=fresh_id("notice"), time_s=time.monotonic(), where="bench", text=str(count))


def episode() -> Episode:
    """The start of a recording."""
    return Episode(
        id=fresh_id("episode"),
        time_s=time.monotonic(),
        task="bench",
        rig="none",
        seed=0,
        simulated=True,
        code_version="",
        config="{}",
    )


def cost(folder: Path, message: Message) -> tuple[float, float]:
    """CPU time [ms] and growth of the file [kB] for one more `message`."""
    file = EpisodeFile(folder / f"{type(message).__name__}.mcap", episode())
    file.write(message, now_s=time.monotonic())
    file.flush()
    size, began_s = file.path.stat().st_size, time.process_time()
    for _ in range(_REPEATS):
        file.write(message, now_s=time.monotonic())
    file.flush()
    cpu_s, grown = time.process_time() - began_s, file.path.stat().st_size - size
    file.close()
    return cpu_s / _REPEATS * 1e3, grown / _REPEATS / 1e3


def arrays() -> tuple[float, float]:
    """CPU time [ms] to make JSON of 34 clouds as nested lists, and packed as the recording does."""
    points = np.random.default_rng(0).normal(size=(34 * 300, 3)).astype(np.float32)
    goal = Goal(id=fresh_id("goal"), time_s=0.0, positions=points)
    began_s = time.process_time()
    for _ in range(_REPEATS):
        msgspec.json.encode(points.tolist())
    middle_s = time.process_time()
    for _ in range(_REPEATS):
        encode(goal, Goal)
    return (middle_s - began_s) / _REPEATS * 1e3, (time.process_time() - middle_s) / _REPEATS * 1e3


def sustain(folder: Path, duration_s: float = 10.0) -> Load:
    """Two cameras at 30 images a second and the particles made of them, as long as asked, and what recording took."""
    messages, writes_s = _Busy(), list[float]()

    async def run() -> tuple[Path, float, int]:
        async with open_recording(folder, episode(), Room()) as recorder:
            began_s, spent_s, count = time.monotonic(), time.process_time(), 0
            while count < duration_s * _RATE_HZ:
                for message in messages.at(count):
                    called_s = time.perf_counter()
                    await recorder.write(message)
                    writes_s.append(time.perf_counter() - called_s)
                count += 1
                await anyio.sleep(max(0.0, began_s + count / _RATE_HZ - time.monotonic()))
            spent_s, took_s = time.process_time() - spent_s, time.monotonic() - began_s
        return recorder.path, spent_s / took_s, recorder.peak

    path, share, peak = anyio.run(run)
    kept = sum(1 for _ in read_messages(path, [Frame, Particles, Notice]))
    ordered = sorted(writes_s)
    return Load(
        share=share,
        p50_s=ordered[len(ordered) // 2],
        p99_s=ordered[int(0.99 * len(ordered))],
        longest_s=ordered[-1],
        lost=len(writes_s) - kept,
        peak=peak,
        mb=path.stat().st_size / 1e6,
    )


def clip(folder: Path, *, session_s: float = 66.0, clip_s: float = 30.0) -> tuple[float, float, float]:
    """Time [s] to cut the end out of a session of two cameras at 4 Hz; both files' sizes [MB]."""
    messages, began_s, last_s = _Busy(), time.monotonic(), 0.0
    file = EpisodeFile(folder / "session.mcap", episode())
    file.write(episode(), now_s=began_s)
    for count in range(round(session_s * _LOOK_HZ)):
        last_s = began_s + count / _LOOK_HZ
        for message in messages.at(count):
            file.write(message, now_s=last_s)
    file.flush()
    cut = Cut(
        session=file.path,
        size_bytes=file.size_bytes,
        since_ns=file.epoch.ns(last_s - clip_s),
        episode=episode(),
        epoch=file.epoch,
    )
    cut_s, goal = time.perf_counter(), folder / "clip.mcap"
    write_clip(cut, goal)
    cut_s = time.perf_counter() - cut_s
    file.close()
    return cut_s, file.path.stat().st_size / 1e6, goal.stat().st_size / 1e6


def kill(context: SpawnContext, *, after_s: float) -> Kill:
    """Kill such an episode `after_s` its first message was taken, and examine the rest."""
    receiver, sender = context.Pipe(duplex=False)
    with tempfile.TemporaryDirectory() as folder:
        process = context.Process(target=_run_episode, args=(folder, sender))
        process.start()
        sender.close()
        last = receiver.recv()
        kill_at_s = time.monotonic() + after_s
        while (left_s := kill_at_s - time.monotonic()) > 0:
            if receiver.poll(left_s):
                last = receiver.recv()
        killed_s = time.monotonic()
        process.kill()
        process.join()
        while receiver.poll():
            try:
                last = receiver.recv()
            except EOFError:
                break
        recovered = recover(next(Path(folder).glob("*.mcap")))
        kept = list(read_messages(recovered.path, [Notice]))
        with recovered.path.open("rb") as stream:
            plain = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    return Kill(
        age_s=killed_s - kept[-1].time_s,
        messages=last + 1 - len(kept),
        lost_bytes=recovered.lost_bytes,
        readable=plain == recovered.messages,
    )


@final
class _Busy:
    """Messages of two cameras at 30 Hz: a pair of images, the particles made of them, and a notice that counts."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        left = frame(rng)
        self._frames = (left, replace(left, camera=replace(left.camera, name="right")))
        points = rng.normal(size=(300, 3)).astype(np.float32)
        surface = rng.normal(size=(5000, 3)).astype(np.float32)
        self._particles = Particles(
            id=fresh_id("particles"), time_s=0.0, positions=points, surface=surface, reconstruction_s=0.05
        )

    def at(self, count: int) -> Iterator[Message]:
        """Messages of one thirtieth of a second."""
        now_s = time.monotonic()
        yield notice(count)
        for picture in self._frames:
            yield replace(picture, id=fresh_id("frame"), time_s=now_s)
        yield replace(self._particles, id=fresh_id("particles"), time_s=now_s)


def _run_episode(folder: str, taken: Connection) -> None:
    """The same until killed; tells the number of each notice that the recorder has."""

    async def run() -> None:
        messages, began_s, count = _Busy(), time.monotonic(), 0
        async with open_recording(Path(folder), episode(), Room()) as recorder:
            while True:
                for message in messages.at(count):
                    await recorder.write(message)
                    if isinstance(message, Notice):
                        taken.send(count)
                count += 1
                await anyio.sleep(max(0.0, began_s + count / _RATE_HZ - time.monotonic()))

    anyio.run(run)


if __name__ == "__main__":
    main()
