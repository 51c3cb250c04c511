"""The page of verdicts and its pictures, made by the commands that it shows: `python -m bench.gallery FOLDER`.

Each case is recorded by `dipac hide` and investigated by `dipac discover`, as a reader would; what is printed there is
what the page has, and the picture is the top of the report as Chromium shows it. Cases whose folders are there are not
made again.
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, final

import tyro

from bench.browser import open_browser
from bench.program import ROOT, hidden_in, joined, run

DOCS: Final = ROOT / "docs"
_AMOUNT: Final = ("--episodes", "5", "--pushes", "3")
_SIZE: Final = {"width": 1180, "height": 760}
_PROGRESS: Final = re.compile(r"^ *\d+ s  ")


@final
@dataclass(frozen=True, kw_only=True)
class Shown:
    """A case of the page: arguments of `dipac hide`, and a sentence before its commands."""

    name: str
    title: str
    about: str
    hidden: tuple[str, ...]
    seed: int

    @property
    def hide(self) -> tuple[str, ...]:
        """The command that records it, without the program's name."""
        return ("hide", *self.hidden, "--seed", str(self.seed), *_AMOUNT, "-o", self.name)

    @property
    def discover(self) -> tuple[str, ...]:
        """The command that investigates it; the shell finds the recordings."""
        return ("discover", f"{self.name}/*.mcap", "-o", f"{self.name}-discovery")


CASES: Final = (
    Shown(
        name="strokes",
        title="An arm whose strokes have the wrong length",
        about="The arm makes 6 % more or less of every stroke than it is told.",
        hidden=("under_reach=0.06",),
        seed=11,
    ),
    Shown(
        name="bent",
        title="A finger that is bent",
        about="The finger's tip is 5 mm beside where the kinematics have it.",
        hidden=("tcp_offset=0.005",),
        seed=12,
    ),
    Shown(
        name="cameras",
        title="Cameras that are elsewhere than calibrated",
        about="Everything is seen 6 mm from where it is.",
        hidden=("hand_eye_translation=0.006",),
        seed=13,
    ),
    Shown(
        name="nothing",
        title="Nothing is hidden",
        about="The control: frictions and stiffness are off by up to 30 %, as in every case, and nothing else is.",
        hidden=(),
        seed=14,
    ),
    Shown(
        name="tilted",
        title="A tilt that is too small for fifteen pushes",
        about="The table is tilted by one degree. Something is wrong, and the program does not say what.",
        hidden=("table_tilt=1.0",),
        seed=15,
    ),
)

_HEAD: Final = """# Five verdicts

Recordings of MuJoCo's cell in which something is hidden, and what `dipac discover` says of them: verdicts that name a
cause, and verdicts that say nothing. Each command can be run as it stands: to record takes about a minute, to
investigate one to five on two cores. This page and its pictures are what they printed and wrote
(`python -m bench.gallery FOLDER`); how often such verdicts are right is in [the results](results.md#hidden-effects).
"""


def section(case: Shown, printed: str, truth: str) -> str:
    """A case as the page has it."""
    lines = "\n".join(line.rstrip() for line in printed.rstrip().splitlines())
    commands = "\n".join(f"dipac {joined(each)}" for each in (case.hide, case.discover))
    return (
        f"## {case.title}\n\n{case.about}\n\n```\n{commands}\n```\n\n```text\n{lines}\n```\n\n"
        f"Hidden was: {truth}.\n\n![The top of the report](images/gallery-{case.name}.png)\n"
    )


def made(case: Shown, folder: Path) -> str:
    """Output of `dipac discover` for a case, which is recorded and investigated first if that has not been done."""
    printed = folder / f"{case.name}.txt"
    if not printed.exists():
        if not (folder / case.name).exists():
            run(case.hide, folder)
        said = run(case.discover, folder)
        printed.write_text("\n".join(line for line in said.splitlines() if not _PROGRESS.match(line)).strip() + "\n")
    return printed.read_text()


def truth_of(case: Shown, folder: Path) -> str:
    """Truth in the sealed file, as text."""
    return hidden_in(json.loads((folder / f"{case.name}.truth.json").read_text(encoding="utf-8")))


def main(
    folder: Annotated[
        tyro.conf.Positional[Path], tyro.conf.arg(help="where recordings and reports go, and are found again")
    ],
    docs: Annotated[Path, tyro.conf.arg(help="where gallery.md and images/ are written")] = DOCS,
) -> None:
    """Record and investigate missing cases, take the pictures, and write the page."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [section(case, made(case, folder), truth_of(case, folder)) for case in CASES]
    with open_browser() as browser:
        page = browser.new_page(viewport=_SIZE)  # pyright: ignore[reportArgumentType] - a size as playwright has it
        for case in CASES:
            page.goto((folder / f"{case.name}-discovery" / "report.html").resolve().as_uri())
            page.screenshot(path=docs / "images" / f"gallery-{case.name}.png")
    (docs / "gallery.md").write_text("\n".join([_HEAD, *parts]), encoding="utf-8")


if __name__ == "__main__":
    tyro.cli(main)
