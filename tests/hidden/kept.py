"""Verdicts on made recordings, which are kept beside the checkout under the hash of what made them."""

import hashlib
import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import TypeAlias

from bench.hidden.beans import BeanCase
from bench.hidden.cloths import ClothCase
from bench.hidden.pours import PourCase
from bench.hidden.recorded import write
from bench.hidden.ropes import RopeCase
from bench.hidden.verdicts import Verdict, verdict

ROOT = Path(__file__).parents[2]
KEPT = ROOT / ".pytest_cache" / "hidden"
Case: TypeAlias = RopeCase | BeanCase | ClothCase | PourCase


def concluded(case: Case) -> Verdict:
    """Verdict of the solver on the recordings of a case: it is given their folder, whose name says nothing."""
    return verdict(sorted(recorded(case).iterdir()))


def recorded(case: Case) -> Path:
    """The folder of a case's recordings, made where it is not there yet."""
    made_of = json.dumps([type(case).__name__, asdict(case)], default=str)
    folder = KEPT / hashlib.sha256((sources() + made_of).encode()).hexdigest()[:16]
    if not folder.exists():
        begun = KEPT / f"begun-{os.getpid()}"
        shutil.rmtree(begun, ignore_errors=True)
        if isinstance(case, ClothCase):
            case.record_in(begun)
        else:
            write(case.record(), begun)
        begun.rename(folder)
    return folder


def sources() -> str:
    """Hash of all that makes recordings."""
    paths = [
        path
        for folder in ("app/rig/simulated", "app/tasks", "app/perception")
        for path in (ROOT / folder).rglob("*.py")
    ]
    paths += [*(ROOT / "bench" / "hidden").glob("*.py"), *(ROOT / "app" / "policy").glob("random_*.py")]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(paths))).hexdigest()
