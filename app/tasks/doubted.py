"""A task's simulator as what discovery doubts."""

from dataclasses import replace
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from app.core.errors import UsageError
from app.discovery.field import MODES
from app.discovery.predict import Predictor, Trials, prepare
from app.discovery.screen import refit
from app.discovery.sensitivity import residuals
from app.discovery.study import Study
from app.discovery.subject import RodModel, Subject, catalogue
from app.planner.actions import LOW_ENOUGH_M, Pushes
from app.sim.catalogue import discover
from app.sim.params import index
from app.tasks.base import Task
from app.tasks.compiled import nominal_model, phi_of

_AT_END: Final = 0.02
"""In a logarithm: a stiffness that is fitted so near the end of its range stands there."""
_AFTER: Final = slice(2 * MODES, 4 * MODES)
"""Rows of residuals after a push."""
_STIFFER: Final = (1.0, 4.0, 16.0)
"""Whence stiff rods are refitted, as multiples of the limpest of them."""


def subject_of(task: Task, *, stiff: bool = False) -> Subject:
    """With the CPU preset's number of particles, and simulated as the task is: as a rod, of TASK@rods.

    What is a cause of its own is not fitted whatever the cause. `stiff`: with the simulator of rods that are stiffer
    than the usual one bears; its nominal rod is as limp as that allows. Raises UsageError for a task without pushes.
    """
    if not isinstance(task.actions, Pushes):
        raise UsageError(f"Discovery reads pushes so far; {task.name} has none.")
    rods = task.rods if task.dynamics == "rods" else None
    causes = {effect.parameters[0].name for effect in discover().values() if effect.catalogued}
    nominal = phi_of(nominal_model(task.name))
    if stiff:
        nominal[index("stiffness")] = task.parameters(stiff=True)[index("stiffness")].nominal
    return Subject(
        scene=task.scene,
        haste=task.haste,
        mass_kg=task.rope.mass_kg,
        length_m=task.rope.length_m,
        radius_m=task.rope.radius_m,
        low_m=task.actions.height_m + LOW_ENOUGH_M,
        particle_count=task.preset("cpu").particle_count,
        nominal=nominal,
        calibrated=tuple(name for name in task.calibrated if name not in causes),
        rods=None if rods is None else RodModel(scene=rods.scene_for(stiff=stiff), contact=tuple(rods.physics.items())),
    )


@threadpool_limits.wrap(limits=1, user_api="blas")
def subject_for(study: Study, task: Task) -> Subject:
    """The simulator of a task in whose range these pushes are.

    That is the one of stiff rods where the usual one, refitted to them, is as stiff as it can be. A refit of those has
    several minima: the nominal rod is the one of `_STIFFER` from which it errs least. Raises as `subject_of`.
    """
    usual = subject_of(task)
    if usual.rods is None or task.rods is None or task.rods.stiff_scene == usual.rods.scene:
        return usual
    trials, known = prepare(study, usual), catalogue(usual.rods)
    column = known.column("stiffness")
    spec = known.specs[column]
    if spec.coordinate(spec.high) - spec.coordinate(float(refit(Predictor(usual, known), trials)[column])) > _AT_END:
        return usual
    stiff = subject_of(task, stiff=True)
    known = catalogue(stiff.rods)
    most, least = known.specs[column].high, float(stiff.nominal[index("stiffness")])
    starts = [_as_stiff(stiff, least * times) for times in _STIFFER if least * times < most]
    return min(starts, key=lambda start: _error_m(Predictor(start, known), trials))


def _as_stiff(subject: Subject, stiffness_pa: float) -> Subject:
    nominal = subject.nominal.copy()
    nominal[index("stiffness")] = stiffness_pa
    return replace(subject, nominal=nominal)


def _error_m(predictor: Predictor, trials: Trials) -> float:
    """The refitted model's mean residual after a push; a push that cannot be simulated has one as large as any."""
    found = residuals(predictor, trials, refit(predictor, trials), (), replicas=0)
    errors = np.linalg.norm(found.r[:, _AFTER], axis=1)
    simulated = found.known[:, _AFTER].any(1)
    return float(np.where(simulated, errors, np.inf).mean())
