"""Stand-ins for the solvers, so that nothing compiles: a planner of strokes, and faults of its results.

The workers themselves are the real ones, and so are the functions that they are asked for (`app.jobs.worker_api`). A
task's compiled functions, and perception's results, belong to each process: there they are replaced by these.
"""

import dataclasses
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any, Final, Literal, TypeAlias, cast, get_args

import numpy as np

from app.config import Site
from app.core.messages import Model, Transition, fresh_id
from app.core.motion import Motion
from app.core.types import Points
from bench.faults.place import KEPT_OUT
from tests.session.planner import Habits, take_up

Plans: TypeAlias = Literal["sound", "nan", "outside", "keep out", "too fast", "backwards", "endless", "none"]
"""Kind of motions that the planner returns."""
Finds: TypeAlias = Literal["true", "nan", "none", "far", "many"]
"""Kind of particles that perception returns."""

_THINKING_S, _CALIBRATING_S = 0.3, 2.0
_TOO_MANY: Final = 1_000_000


def stand_in(plans: Plans = "sound") -> None:
    """Plan, from now on and in this process, corrupted strokes as fast as the site allows, and calibrate by waiting."""
    take_up(Habits(thinking_s=_THINKING_S), partial(_fast, _SPOILT[plans]))
    compiled = cast(Any, sys.modules["app.jobs.jit_cache"])
    compiled.calibrate_model, compiled.now = _calibrated, None


def _fast(spoil: Callable[[Motion], Motion], motion: Motion, site: Site) -> Motion:
    speeds = np.full(len(motion.speeds), site.limits.speed_m_s)
    return spoil(Motion(positions=motion.positions, speeds=speeds))


def _with(motion: Motion, positions: np.ndarray) -> Motion:
    return Motion(positions=positions, speeds=np.full(len(positions), motion.speeds[0]))


def _through(motion: Motion) -> Motion:
    low, high = np.array(KEPT_OUT.low), np.array(KEPT_OUT.high)
    middle, aside = (low + high) / 2, np.array([0.15, 0.0, 0.0])
    return _with(motion, np.stack([middle - aside, middle + aside]))


_SPOILT: Final[Mapping[Plans, Callable[[Motion], Motion]]] = {
    "sound": lambda motion: motion,
    "nan": lambda motion: _with(motion, np.full_like(motion.positions, np.nan)),
    "outside": lambda motion: _with(motion, motion.positions + np.array([0.0, 0.0, 2.0])),
    "keep out": _through,
    "too fast": lambda motion: dataclasses.replace(motion, speeds=100 * motion.speeds),
    "backwards": lambda motion: dataclasses.replace(motion, speeds=-motion.speeds),
    "endless": lambda motion: _with(motion, np.repeat(motion.positions[:1], _TOO_MANY, axis=0)),
    "none": lambda motion: _with(motion, motion.positions[:0]),
}


def _calibrated(_task: str, _preset: str, transitions: Sequence[Transition], model: Model, _how: object) -> object:
    """The same model, as of one more transition, after a while."""
    time.sleep(_CALIBRATING_S)
    new = dataclasses.replace(
        model,
        id=fresh_id("model"),
        time_s=time.monotonic(),
        version=model.version + 1,
        transition_count=len(transitions),
    )
    return SimpleNamespace(model=new, lost=())


def spoil_particles(finds: Finds) -> None:
    """Replace perception's results by such particles from now on. To be run in perception's process."""
    from app.perception import reconstruct

    true = getattr(reconstruct, "true_reconstruct", reconstruct.reconstruct)
    found = cast(Any, reconstruct)
    found.true_reconstruct = true
    found.reconstruct = true if finds == "true" else partial(_spoilt, true, finds)


def _spoilt(true: Callable[..., Any], finds: Finds, *arguments: object) -> object:
    found = true(*arguments)
    x: Points = found.positions
    spoilt: Mapping[Finds, Points] = {
        "nan": np.full_like(x, np.nan),
        "none": x[:0],
        "far": x + np.float32(1e6),
        "many": np.resize(x, (_TOO_MANY, 3)),
    }
    return dataclasses.replace(found, positions=spoilt[finds])


PLANS, FINDS = get_args(Plans), get_args(Finds)
