"""One case from its draw to a line of results: make the recordings, seal the truth, let the solver see them alone.

Every step is a process of its own. The solver's folder has the recordings and nothing else, and its name says nothing;
the truth is in a file that only this process reads, after the verdict.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from app.policy.strokes import Plan
from app.rig.simulated.hiding import known
from bench.hidden.draws import WORLDS, Case

_KEPT = ("verdict", "causes", "ranking", "formula", "leftover", "heldout", "limits", "amount", "spent_s")
"""Of a verdict, in a line of results: all but tracks and sentences."""
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
"""Where several processes share a machine: a thread of BLAS each, and as much of a GPU's memory as they need."""
_CURRENT = ("PATH", "HOME", "LANG", "TMPDIR", "XDG_CACHE_HOME", "CUDA_VISIBLE_DEVICES", "LD_LIBRARY_PATH")
"""Variables that a solver is given; others might say what is hidden."""


@final
@dataclass(frozen=True, kw_only=True)
class Setup:
    """How cases are made and solved. `seed` is of all draws; `deadline_s` of each process.

    `made`: where recordings are kept with their truth, a folder a case, and taken from where they are there already.
    """

    seed: int
    plan: Plan
    oracle: bool
    deadline_s: float
    made: Path | None = None


def tried(case: Case, setup: Setup) -> dict[str, Any]:
    """A line of results; where something failed, `failure` says what."""
    began = time.monotonic()
    line: dict[str, Any] = {"case": told(case, setup)}
    kept = _kept(case, setup)
    with tempfile.TemporaryDirectory() as sealed, tempfile.TemporaryDirectory() as seen:
        try:
            truth = make(case, setup, Path(sealed)) if kept is None else _made(kept, case, setup, Path(sealed))
            recordings = handed_over((kept or Path(sealed)) / "recordings", Path(seen))
            line["verdict"] = solved(recordings, Path(seen), setup.deadline_s)
            line["truth"] = truth
            causes = [each["effect"] for each in truth["effects"]]
            if setup.oracle and causes and all(each["catalogued"] for each in truth["effects"]):
                line["oracle"] = _asked(recordings, causes, Path(sealed), setup.deadline_s)
        except (subprocess.SubprocessError, OSError, ValueError) as error:
            line["failure"] = _why(error)
    line["took_s"] = round(time.monotonic() - began, 1)
    return line


def told(case: Case, setup: Setup) -> dict[str, Any]:
    """What a line says of its case."""
    return {
        "number": case.number,
        "world": case.world,
        "seed": setup.seed,
        "episodes": setup.plan.episodes,
        "pushes": setup.plan.pushes,
        "hidden": [[each.effect, each.size] for each in case.hidden],
    }


def make(case: Case, setup: Setup, folder: Path) -> dict[str, Any]:
    """Recordings in `folder`/recordings; returns the truth."""
    seed = int(np.random.SeedSequence([setup.seed, case.number, WORLDS.index(case.world)]).generate_state(1)[0])
    size = ["--episodes", str(setup.plan.episodes), "--pushes", str(setup.plan.pushes)]
    if case.world == "own":
        orders = folder / "orders.json"
        hidden = [[each.effect, each.size] for each in case.hidden]
        orders.write_text(json.dumps([{"name": "made", "seed": seed, "hidden": hidden}]), encoding="utf-8")
        _run(["bench.hidden.own", str(orders), "-o", str(folder), *size], setup.deadline_s)
        (folder / "made" / "recordings").rename(folder / "recordings")
        return json.loads((folder / "made" / "truth.json").read_text(encoding="utf-8"))
    wishes = [f"{each.effect}={_real(each.effect, each.size):.6g}" for each in case.hidden]
    truth = folder / "truth.json"
    places = ["-o", str(folder / "recordings"), "--truth", str(truth)]
    _run(["app", "hide", *wishes, "--seed", str(seed), *size, *places], setup.deadline_s)
    return json.loads(truth.read_text(encoding="utf-8"))


def _kept(case: Case, setup: Setup) -> Path | None:
    """The folder of a case whose recordings are kept."""
    if setup.made is None:
        return None
    return setup.made / f"{case.key}-{setup.seed}-{setup.plan.episodes}x{setup.plan.pushes}"


def _made(kept: Path, case: Case, setup: Setup, folder: Path) -> dict[str, Any]:
    """The truth of the recordings that are kept; where there are none they are made in `folder`, and moved.

    The truth is written last: a folder without it is half done, and made anew.
    """
    finished = kept / "truth.json"
    if not finished.exists():
        shutil.rmtree(kept, ignore_errors=True)
        truth = make(case, setup, folder)
        kept.mkdir(parents=True)
        shutil.move(folder / "recordings", kept / "recordings")
        finished.write_text(json.dumps(truth), encoding="utf-8")
    return json.loads(finished.read_text(encoding="utf-8"))


def handed_over(made: Path, folder: Path) -> list[Path]:
    """Copies of the recordings in the solver's folder, dated alike."""
    paths = list[Path]()
    for path in sorted(made.glob("*.mcap")):
        copy = folder / path.name
        shutil.copyfile(path, copy)
        os.utime(copy, (0, 0))
        paths.append(copy)
    return paths


def solved(recordings: Sequence[Path], folder: Path, deadline_s: float) -> dict[str, Any]:
    """What `dipac discover` concludes, in a process that is given the recordings and nothing else.

    It doubts material points: so does the oracle, and so do the recordings of our own engine in other numerics.
    """
    names = [path.name for path in recordings]
    environment = {name: os.environ[name] for name in _CURRENT if name in os.environ}
    _run(
        ["app", "discover", *names, "-o", "discovery", "--dynamics", "mpm"],
        deadline_s,
        folder=folder,
        environment=environment,
    )
    verdict = json.loads((folder / "discovery" / "verdict.json").read_text(encoding="utf-8"))
    return {name: verdict[name] for name in _KEPT}


def _asked(recordings: Sequence[Path], causes: Sequence[str], folder: Path, deadline_s: float) -> dict[str, float]:
    output = folder / "oracle.json"
    _run(["bench.hidden.oracle", *map(str, recordings), "-o", str(output), "--causes", *causes], deadline_s)
    return json.loads(output.read_text(encoding="utf-8"))


def _real(name: str, size: float) -> float:
    """A size in typical ones in the effect's own unit, as far as it can be."""
    main = known()[name].main
    assert main.typical is not None
    return float(np.clip(main.null + size * (main.typical - main.null), main.low, main.high))


def _run(
    module: Sequence[str],
    deadline_s: float,
    *,
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> None:
    """`python -m` of these words. Raises SubprocessError where it fails or takes longer."""
    subprocess.run(
        [sys.executable, "-m", *module],
        check=True,
        capture_output=True,
        text=True,
        timeout=deadline_s,
        cwd=folder,
        env={**(os.environ if environment is None else environment), **_ENVIRONMENT},
    )


def _why(error: Exception) -> str:
    said = getattr(error, "stderr", None) or ""
    text = said.decode(errors="replace") if isinstance(said, bytes) else said
    last = text.strip().splitlines()[-1:] if text.strip() else []
    return " ".join([type(error).__name__, *(last or [str(error)])])[:500]
