"""What recording costs and what a kill takes: `python -m bench.recording`."""

import multiprocessing
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import final

import anyio
import msgspec
import numpy as np
from rich.console import Console
from rich.table import Table

from app.core.messages import CameraModel, Episode, Executed, Frame, Goal, Message, Notice, Particles, fresh_id
from app.recording.codec import encode
from app.recording.file import EpisodeFile
from app.recording.preflight import Room
from app.recording.reader import read_messages
from app.recording.recover import recover
from app.recording.writer import open_recording

_REPEATS = 50
_NOTICE_PERIOD_S = 0.02
_FRAME_EVERY = 5


@final
@dataclass(frozen=True, kw_only=True)
class Kill:
    """What one SIGKILL took: the age [s] of the last message that survived, and how many after it did not."""

    age_s: float
    messages: int
    lost_bytes: int


def main(kills: int = 10) -> None:
    """Print the cost of each large message, of arrays in JSON, and what kills took."""
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
    context = multiprocessing.get_context("spawn")
    lost = [kill(context, after=30 + 11 * n) for n in range(kills)]
    ages = sorted(k.age_s for k in lost)
    terminal.print(
        f"Age of the last message after a kill: median {ages[len(ages) // 2]:.3f} s, worst {ages[-1]:.3f} s."
    )
    terminal.print(f"Messages lost: at most {max(k.messages for k in lost)} of {1 / _NOTICE_PERIOD_S:.0f} a second; ")
    terminal.print(f"bytes that made no sense: {max(k.lost_bytes for k in lost)}.")


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


def kill(context: SpawnContext, *, after: int) -> Kill:
    """Kill an episode once `after` notices have been taken, and see what is left."""
    receiver, sender = context.Pipe(duplex=False)
    with tempfile.TemporaryDirectory() as folder:
        process = context.Process(target=_run_episode, args=(folder, sender))
        process.start()
        sender.close()
        last = -1
        while last < after:
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
    return Kill(age_s=killed_s - kept[-1].time_s, messages=last + 1 - len(kept), lost_bytes=recovered.lost_bytes)


def _run_episode(folder: str, taken: Connection) -> None:
    """Fifty notices and ten image pairs a second until killed; tells each notice that the recorder has."""

    async def run() -> None:
        picture, count = frame(np.random.default_rng(0)), 0
        async with open_recording(Path(folder), episode(), Room()) as recorder:
            while True:
                await recorder.write(notice(count))
                if count % _FRAME_EVERY == 0:
                    await recorder.write(picture)
                taken.send(count)
                count += 1
                await anyio.sleep(_NOTICE_PERIOD_S)

    anyio.run(run)


if __name__ == "__main__":
    main()
