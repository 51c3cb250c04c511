"""One case from its draw to a line of results: make the recordings, seal the truth, let the solver see them alone.

Every step is a process of its own. The solver's folder has the recordings and nothing else, and its name says nothing;
the truth is in a file that only this process reads, after the verdict.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, final

import numpy as np

from app.core.geometry.scene_description import Rope
from app.policy.random_pushes import PushDesign
from bench.hidden.draws import AS_RODS, USUAL_CASES, WORLDS, Case, CaseDistribution, Making, kinds, real_size
from bench.hidden.sizes import FLAT, drawn_cameras, drawn_task

_KEPT = ("verdict", "causes", "ranking", "formula", "leftover", "heldout", "limits", "amount", "spent_s")
"""Entries of a verdict that a line of results keeps: all but tracks and sentences."""
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
"""Environment that lets processes share a machine: a thread of BLAS each, and only the GPU memory that they need."""
_CURRENT = (
    "PATH",
    "HOME",
    "LANG",
    "TMPDIR",
    "XDG_CACHE_HOME",
    "CUDA_VISIBLE_DEVICES",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "MUJOCO_GL",
)
"""Environment variables of a solver; others might reveal the truth."""
_POLL_S = 0.05
"""Polling period of a process's exit."""


@final
@dataclass(frozen=True, kw_only=True)
class Setup:
    """Conditions under which cases are made and solved. `seed` is of all draws; `deadline_s` of each process.

    `cases`: what is drawn. `oracle`, `baselines`: also fit the hidden cause, and run other methods. `made`: folder
    of recordings with their truth, a folder a case; those already there are used.
    """

    seed: int
    plan: PushDesign
    oracle: bool
    deadline_s: float
    making: Making = AS_RODS
    cases: CaseDistribution = USUAL_CASES
    baselines: bool = False
    made: Path | None = None


@final
@dataclass(frozen=True, kw_only=True)
class Spent:
    """Time and peak memory of a process and those that it started."""

    wall_s: float
    processor_s: float
    peak_mb: float


def tried(case: Case, setup: Setup) -> dict[str, Any]:
    """A line of results; `failure` is the reason if something failed."""
    began = time.monotonic()
    line: dict[str, Any] = {"case": told(case, setup)}
    kept = _kept(case, setup)
    with tempfile.TemporaryDirectory() as sealed, tempfile.TemporaryDirectory() as seen:
        try:
            truth = make(case, setup, Path(sealed)) if kept is None else _made(kept, case, setup, Path(sealed))
            truth = doubted(truth, case, setup)
            recordings = handed_over((kept or Path(sealed)) / "recordings", Path(seen))
            line["verdict"], spent = solved(recordings, Path(seen), setup)
            line["spent"] = vars(spent)
            line["truth"] = truth
            causes = [each["effect"] for each in truth["effects"]]
            if setup.oracle and causes and all(each["catalogued"] for each in truth["effects"]):
                line["oracle"] = _asked("oracle", recordings, Path(sealed), setup, ["--causes", *causes])
            if setup.baselines:
                line["baselines"] = _asked("baselines", recordings, Path(sealed), setup)
        except (subprocess.SubprocessError, OSError, ValueError) as error:
            line["failure"] = _why(error)
    line["took_s"] = round(time.monotonic() - began, 1)
    return line


def told(case: Case, setup: Setup) -> dict[str, Any]:
    """Case entry of a line."""
    return {
        "number": case.number,
        "world": case.world,
        "task": setup.making.task,
        "dynamics": setup.making.dynamics,
        "images": setup.making.images and setup.making.is_of_cell(case.world),
        "seed": setup.seed,
        "episodes": setup.plan.episodes,
        "pushes": setup.plan.pushes,
        "sizes": list(setup.cases.sizes),
        "family": setup.cases.family,
        "hidden": [[each.effect, each.size] for each in case.hidden],
    }


def make(case: Case, setup: Setup, folder: Path) -> dict[str, Any]:
    """Recordings in `folder`/recordings; returns the truth.

    Where ropes are rods, object and tool are drawn, too; material points are of the cell's.
    """
    seed = int(np.random.SeedSequence([setup.seed, case.number, WORLDS.index(case.world)]).generate_state(1)[0])
    hidden = [[each.effect, each.size] for each in case.hidden]
    order = {"name": "made", "task": setup.making.task, "seed": seed, "hidden": hidden}
    if setup.making.is_of_cell(case.world) and setup.making.images:
        return _rendered(case, setup, seed, folder)
    if setup.making.dynamics == "mpm" and setup.making.body is Rope:
        if case.world == "mujoco":
            raise ValueError("MuJoCo's world without images is of drawn ropes, which are doubted as rods.")
        return _of_material_points(order, setup, folder)
    orders = folder / "order.json"
    size = {"world": case.world, "episodes": setup.plan.episodes, "pushes": setup.plan.pushes}
    orders.write_text(json.dumps(order | size), encoding="utf-8")
    _run(["bench.hidden.made", str(orders), "-o", str(folder)], setup.deadline_s)
    return json.loads((folder / "truth.json").read_text(encoding="utf-8"))


def _rendered(case: Case, setup: Setup, seed: int, folder: Path) -> dict[str, Any]:
    """MuJoCo's world in images: `dipac hide`."""
    wishes = [f"{each.effect}={real_size(each, setup.making.body):.6g}" for each in case.hidden]
    truth, scene = folder / "truth.json", ["--task", setup.making.task]
    if setup.making.dynamics == "rods":
        cameras, noise_m = drawn_cameras(seed)
        scene = ["--task", drawn_task(seed, "rods", flat=FLAT)]
        scene += ["--cameras", str(cameras), "--depth-noise-mm", f"{1e3 * noise_m:.3g}"]
    places = ["-o", str(folder / "recordings"), "--truth", str(truth)]
    _run(["app", "hide", *wishes, "--seed", str(seed), *_amount(setup), *scene, *places], setup.deadline_s)
    return json.loads(truth.read_text(encoding="utf-8"))


def _of_material_points(order: Mapping[str, Any], setup: Setup, folder: Path) -> dict[str, Any]:
    """Our own engine of material points, in other numerics."""
    orders = folder / "orders.json"
    orders.write_text(json.dumps([order]), encoding="utf-8")
    _run(["bench.hidden.own", str(orders), "-o", str(folder), *_amount(setup)], setup.deadline_s)
    (folder / "made" / "recordings").rename(folder / "recordings")
    return json.loads((folder / "made" / "truth.json").read_text(encoding="utf-8"))


def _amount(setup: Setup) -> list[str]:
    return ["--episodes", str(setup.plan.episodes), "--pushes", str(setup.plan.pushes)]


def doubted(truth: Mapping[str, Any], case: Case, setup: Setup) -> dict[str, Any]:
    """The truth, in which that is catalogued which the solver's catalogue has: rods know no adhesion."""
    known = kinds(case.world, setup.making)
    effects = [{**each, "catalogued": each["effect"] in known} for each in truth["effects"]]
    return {**truth, "effects": effects}


def _kept(case: Case, setup: Setup) -> Path | None:
    """The folder of a case whose recordings are kept."""
    if setup.made is None:
        return None
    words = (case.key, setup.seed, f"{setup.plan.episodes}x{setup.plan.pushes}", *_way(setup))
    return setup.made / "-".join(map(str, words))


def _way(setup: Setup) -> list[str]:
    """Words for unusual conditions of the recordings."""
    making = setup.making
    engine = "mpm" if making.body is Rope else making.task
    drawn = [*map(str, setup.cases.sizes), setup.cases.family or "any"] if setup.cases != USUAL_CASES else []
    return [engine] * (making.dynamics == "mpm") + ["blind"] * (not making.images) + drawn


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


def solved(recordings: Sequence[Path], folder: Path, setup: Setup) -> tuple[dict[str, Any], Spent]:
    """Verdict of `dipac discover`, in a process that is given the recordings and nothing else."""
    names = [path.name for path in recordings]
    environment = {name: os.environ[name] for name in _CURRENT if name in os.environ}
    order = ["app", "discover", *names, "-o", "discovery", "--dynamics", setup.making.dynamics]
    spent = _run(order, setup.deadline_s, folder=folder, environment=environment)
    verdict = json.loads((folder / "discovery" / "verdict.json").read_text(encoding="utf-8"))
    return {name: verdict[name] for name in _KEPT}, spent


def _asked(
    module: str, recordings: Sequence[Path], folder: Path, setup: Setup, options: Sequence[str] = ()
) -> dict[str, Any]:
    """Results of another module of the bench for the recordings."""
    output = folder / f"{module}.json"
    order = [*map(str, recordings), "-o", str(output), "--dynamics", setup.making.dynamics, *options]
    _run([f"bench.hidden.{module}", *order], setup.deadline_s)
    return json.loads(output.read_text(encoding="utf-8"))


def _run(
    module: Sequence[str],
    deadline_s: float,
    *,
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> Spent:
    """`python -m` of these words. Raises SubprocessError where it fails or takes longer."""
    order = [sys.executable, "-m", *module]
    given = {**(os.environ if environment is None else environment), **_ENVIRONMENT}
    began = time.monotonic()
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(order, stdout=subprocess.DEVNULL, stderr=said, cwd=folder, env=given)
        try:
            status, usage = _waited(process.pid, began + deadline_s)
        except BaseException as error:
            process.kill()
            process.wait()
            if isinstance(error, TimeoutError):
                raise subprocess.TimeoutExpired(order, deadline_s) from None
            raise
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise subprocess.CalledProcessError(process.returncode, order, stderr=_text(said))
    return Spent(
        wall_s=round(time.monotonic() - began, 1),
        processor_s=round(usage.ru_utime + usage.ru_stime, 1),
        peak_mb=round(usage.ru_maxrss / 1024, 1),
    )


def _waited(pid: int, until_s: float) -> tuple[int, resource.struct_rusage]:
    """Exit status of a process, and its resource usage. Raises TimeoutError if it takes longer."""
    while time.monotonic() < until_s:
        done, status, usage = os.wait4(pid, os.WNOHANG)
        if done:
            return status, usage
        time.sleep(_POLL_S)
    raise TimeoutError


def _text(said: IO[bytes]) -> str:
    said.seek(0)
    return said.read().decode(errors="replace")


def _why(error: Exception) -> str:
    said = getattr(error, "stderr", None) or ""
    text = said.decode(errors="replace") if isinstance(said, bytes) else said
    last = text.strip().splitlines()[-1:] if text.strip() else []
    return " ".join([type(error).__name__, *(last or [str(error)])])[:500]
