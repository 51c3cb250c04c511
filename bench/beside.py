"""Robustness of the arm to a busy computer: `dipac run` beside a browser that renders in software, and a busy loop.

`python -m bench.beside --seeds 10` prints a row an episode: the motions made, and those that were stopped, with the
reason. A stop by the watchdog must not happen: the computer was late, not the robot wrong.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, final

import psutil
import tyro
from playwright.sync_api import Browser, Error
from rich.console import Console
from rich.table import Table

from app.core.dialogue.words import millimetres
from app.core.messages import Executed
from app.recording.read.reader import read_messages
from bench.browser import console_url, open_browser

_PATIENCE_S, _PATIENCE_MS = 1200, 60_000


@final
@dataclass(frozen=True, kw_only=True)
class Episode:
    """Outcome of an episode: `reasons` of each motion that was stopped; `rc` is the program's exit status."""

    seed: int
    motions: int
    reasons: list[str]
    words: str
    rc: int


def main(
    seeds: int = 10,
    pushes: Annotated[int, tyro.conf.arg(help="at most, an episode")] = 10,
    loops: Annotated[int, tyro.conf.arg(help="processes that are busy all the time, one core each")] = 1,
    pages: Annotated[int, tyro.conf.arg(help="of the console, open in the browser")] = 1,
) -> None:
    """Run the episodes one after another, and print the table."""
    table = Table("seed", "motions", "stopped", "from the goal", "why", title=f"{pages} pages, {loops} busy loops")
    with tempfile.TemporaryDirectory() as folder, open_browser() as browser, _busy(loops):
        for seed in range(seeds):
            episode = _episode(seed, pushes, pages, browser, Path(folder))
            why = "; ".join(episode.reasons) or ("" if episode.rc == 0 else f"ended with {episode.rc}")
            table.add_row(str(seed), str(episode.motions), str(len(episode.reasons)), episode.words, why)
            print(f"{seed}: {episode}", file=sys.stderr, flush=True)
    Console().print(table)


def _episode(seed: int, pushes: int, pages: int, browser: Browser, folder: Path) -> Episode:
    outcome = folder / f"{seed}.json"
    with _program(seed, pushes, folder, outcome) as (process, url):
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        context.set_default_timeout(_PATIENCE_MS)
        for _ in range(pages):
            with suppress(Error):  # The program may be done before a busy browser has opened it.
                context.new_page().goto(url, wait_until="commit")
        for _ in process.stdout or ():
            pass  # Read, so that it never waits for a reader.
        code = process.wait(timeout=_PATIENCE_S)
        context.close()
    row = json.loads(outcome.read_text())
    executed = [each for each in read_messages(Path(row["recording"])) if isinstance(each, Executed)]
    return Episode(
        seed=seed,
        motions=len(executed),
        reasons=[each.reason for each in executed if each.outcome == "stopped"],
        words=f"{millimetres(row['chamfer_m2'][0]):.1f} to {millimetres(row['last_chamfer_m2']):.1f} mm",
        rc=code,
    )


@contextmanager
def _program(seed: int, pushes: int, folder: Path, outcome: Path) -> Generator[tuple[subprocess.Popen[str], str]]:
    """One episode that runs, and the URL of its console."""
    asked = ["run", "rope_push", "--seed", str(seed), "--pushes", str(pushes), "--port", "0", "--json", str(outcome)]
    with subprocess.Popen(
        [sys.executable, "-m", "app", *asked, "--recordings", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    ) as process:
        try:
            yield process, console_url(process.stdout or ())
        finally:
            process.terminate()


@contextmanager
def _busy(loops: int) -> Generator[None]:
    """Processes that do nothing, as fast as they can, each on a core of its own as far as there are any."""
    cores = psutil.Process().cpu_affinity() or [0]
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(loops)]
    try:
        for index, each in enumerate(busy):
            psutil.Process(each.pid).cpu_affinity([cores[index % len(cores)]])
        yield
    finally:
        for each in busy:
            each.kill()
            each.wait()


if __name__ == "__main__":
    tyro.cli(main)
