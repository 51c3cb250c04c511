"""Stages in which a task's programs are compiled before its first decision."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from app.calibration.evidence import Evidence
from app.calibration.fit import FitSettings
from app.config import ANYWHERE, Confines
from app.core.messages import Model
from app.jobs.jit_cache import calibrator, nominal_model, phi_of, planner
from app.planner.method import DIPAC, Method
from app.policy.base import PARKED_POSE
from app.sim.model.params import with_orientation
from app.tasks import load


@final
@dataclass(frozen=True)
class CompileStep:
    """A compilation step: its name, and the function that does it."""

    name: str
    run: Callable[[], object]


def stages(
    task: str,
    preset: str,
    model: Model | None = None,
    method: Method = DIPAC,
    confines: Confines = ANYWHERE,
    *,
    learning: bool = False,
) -> list[CompileStep]:
    """Compilation steps for `model`, or the nominal one, in order; each after the first is quick after it.

    Where models are learned in another process, that compiles what it needs once the first motion has been seen.
    """
    data, size = load(task), load(task).preset(preset)
    x = data.goal(0, size.particle_count)
    phi = phi_of(model or nominal_model(task))
    fitted = with_orientation(phi, 0.0)

    def simulator() -> None:
        example = Evidence(
            before=x[None], tool=data.actions.measured_path(np.tile(PARKED_POSE, (2, 1)))[None], after=x[None]
        )
        calibrator(task, preset, FitSettings(), fitted).predictor.compile(fitted, example)

    plans = CompileStep(
        "the simulator and the planner's search",
        lambda: planner(task, preset, phi, method, confines).compile(x, phi),
    )
    return [plans, CompileStep("the calibration", simulator)] if learning else [plans]
