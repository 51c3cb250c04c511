"""Odd copies of files for each reader: `python -m bench.fuzz goal goals/*.ply --minutes 30`.

Copies of the named files are cut, joined and overwritten at random. A reader accepts such a copy or refuses it with one
of the program's own errors, in one line; anything else is a failure: another exception, a case of more than `--slow`
seconds, memory above a gigabyte. What failed is kept. The same seed makes the same copies.
"""

import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import FrameType
from typing import Annotated, Final, Literal, NamedTuple, NoReturn

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from app.core.errors import DipacError

_TASK: Final = "rope_push"
_MOST_MB: Final = 1024.0
_TEXT: Final = frozenset({".toml", ".csv", ".json"})
_ODD: Final = (
    *(
        b"nan",
        b"-inf",
        b"1e999",
        b"-1",
        b"0x10",
        b"[]",
        b"{}",
        b"true",
        b"''",
        b"\n\n",
        b"= =",
        b"[[a]]",
        b",,",
        b"\x00",
    ),
    *("é".encode(), b"\xff\xfe", b"9" * 40, b"\xff" * 8, b"\x00" * 64, b"\x7f\xff\xff\xff"),
)
"""Pieces that are put in."""


def _recording(path: Path) -> object:
    from app.recording.read.reader import read_cameras, read_messages, read_transitions

    return [*read_messages(path), *read_transitions(path), *read_cameras(path)]


def _import(path: Path) -> object:
    from app.recording.exchange.npz_import import read_plain

    return read_plain(path)


def _bag(path: Path) -> object:
    from app.recording.exchange.foreign_file import open_foreign

    with open_foreign(path) as source:
        return source


def _goal(path: Path) -> object:
    from app.commands._goal import read_goal

    return read_goal(path)


def _model(path: Path) -> object:
    from app.recording.exchange.model_file import load_model

    return load_model(path, task=_TASK, time_s=0.0)


def _cell(path: Path) -> object:
    from app.cells.cell_file import load_cell

    return load_cell(path)


def _poses(path: Path) -> object:
    from app.commands.calibration._session import read_poses

    return read_poses(path)


def _cameras(path: Path) -> object:
    from app.recording.exchange.calibration_file import load_cameras

    return load_cameras(path)


def _segmenter(path: Path) -> object:
    from app.commands._sight import load_tried_segmenter

    return load_tried_segmenter(path, 1)


def _object(path: Path) -> object:
    from app.recording.exchange.object_file import load_object

    return load_object(path)


Reader = Literal["recording", "import", "bag", "goal", "model", "cell", "poses", "cameras", "segmenter", "object"]
READERS: Final[Mapping[Reader, Callable[[Path], object]]] = {
    "recording": _recording,
    "import": _import,
    "bag": _bag,
    "goal": _goal,
    "model": _model,
    "cell": _cell,
    "poses": _poses,
    "cameras": _cameras,
    "segmenter": _segmenter,
    "object": _object,
}


class Tally(NamedTuple):
    """Outcome of a run: numbers of cases, the longest of them [s], and the process's peak memory [MB]."""

    accepted: int
    refused: int
    failures: Mapping[str, int]
    slowest_s: float
    peak_mb: float


def main(
    reader: tyro.conf.Positional[Reader],
    files: tyro.conf.Positional[tuple[Path, ...]],
    /,
    *,
    minutes: Annotated[float, tyro.conf.arg(help="of processor time")] = 1.0,
    slow: Annotated[float, tyro.conf.arg(help="seconds from which a case is a failure")] = 20.0,
    seed: Annotated[int, tyro.conf.arg(help="of the copies")] = 0,
    keep: Annotated[Path, tyro.conf.arg(help="folder of copies that failed")] = Path(".cache/fuzz"),
) -> None:
    """Read odd copies of files until the time is over, and print what came of them."""
    found = fuzz(READERS[reader], files, np.random.default_rng(seed), 60 * minutes, slow, keep / reader)
    shown = Table("reader", "accepted", "refused", "failed", "slowest [s]", "peak [MB]")
    failed = sum(found.failures.values())
    shown.add_row(
        reader, *map(str, (found.accepted, found.refused, failed)), f"{found.slowest_s:.2f}", f"{found.peak_mb:.0f}"
    )
    terminal = Console()
    terminal.print(shown)
    for why, count in found.failures.items():
        terminal.print(f"{count} x {why}", markup=False)
    if failed or found.peak_mb > _MOST_MB:
        sys.exit(1)


def fuzz(
    read: Callable[[Path], object],
    sources: Iterable[Path],
    rng: np.random.Generator,
    spent_s: float,
    slow_s: float,
    keep: Path,
) -> Tally:
    """Read odd copies of `sources`, files or folders, for so much processor time; failed copies are left in `keep`."""
    paths, counts, failures = list(sources), Counter[str](), Counter[str]()
    slowest, end = 0.0, _processor_s() + spent_s
    signal.signal(signal.SIGALRM, _too_slow)
    with tempfile.TemporaryDirectory(prefix="dipac-") as folder:
        while _processor_s() < end:
            copy = _odd_copy(paths[rng.integers(len(paths))], Path(folder), rng)
            began = time.monotonic()
            signal.setitimer(signal.ITIMER_REAL, slow_s)
            try:
                read(copy)
                counts["accepted"] += 1
            except DipacError as error:
                counts["refused"] += 1
                if "\n" in str(error):
                    failures["a refusal of several lines"] += _kept(copy, keep, failures["a refusal of several lines"])
            except Exception as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                why = f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}: {error}"[:200]
                failures[why] += _kept(copy, keep, failures[why])
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            slowest = max(slowest, time.monotonic() - began)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return Tally(counts["accepted"], counts["refused"], dict(failures), slowest, peak_mb)


def _processor_s() -> float:
    """Processor time of this process and of those that it waited for."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in both)


def _too_slow(_: int, __: FrameType | None) -> NoReturn:
    raise TimeoutError("A case takes too long.")


def _kept(copy: Path, keep: Path, before: int) -> int:
    """Keep the first copy that fails in a way; returns one, to be added."""
    if not before:
        keep.mkdir(parents=True, exist_ok=True)
        kept = keep / f"{time.monotonic_ns()}{copy.suffix}"
        (shutil.copytree if copy.is_dir() else shutil.copyfile)(copy, kept)
    return 1


def _odd_copy(source: Path, folder: Path, rng: np.random.Generator) -> Path:
    """A copy of a file, or of a folder with one or two of its files, that is damaged."""
    for last in folder.iterdir():
        shutil.rmtree(last) if last.is_dir() else last.unlink()
    copy = folder / f"{rng.integers(2**31)}{source.suffix}"  # A reader may remember a file by its name.
    (shutil.copytree if source.is_dir() else shutil.copyfile)(source, copy)
    files = sorted(path for path in copy.rglob("*") if path.is_file()) if copy.is_dir() else [copy]
    for _ in range(int(rng.integers(1, 3))):
        path = files[rng.integers(len(files))]
        path.write_bytes(_damaged(path.read_bytes(), rng, text=path.suffix in _TEXT))
    return copy


def _damaged(data: bytes, rng: np.random.Generator, *, text: bool) -> bytes:
    """Bytes with a few pieces cut out, doubled, or replaced by odd ones; a quarter of the binary ones cut off."""
    if not text and rng.uniform() < 0.25:
        return data[: rng.integers(len(data) + 1)]
    for _ in range(int(rng.integers(1, 5))):
        at, long = int(rng.integers(len(data) + 1)), int(rng.integers(0, 24))
        other = int(rng.integers(len(data) + 1))
        put = _ODD[rng.integers(len(_ODD))] if rng.uniform() < 0.6 else data[other : other + int(rng.integers(24))]
        data = data[:at] + put + data[at + (long if text or rng.uniform() < 0.5 else len(put)) :]
    return data


if __name__ == "__main__":
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    tyro.cli(main)
