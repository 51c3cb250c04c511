"""Worker API of a task: plain functions of picklable arguments, run in worker processes.

Compiled functions stay in the process that runs them (`app.jobs.jit_cache`), and load there alone: a process that
only names these functions loads neither JAX nor Warp.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.config import Site
from app.core.errors import PlanningError, SimulationError
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.planner.method import DIPAC, Method

_log = logging.getLogger(__name__)

_PROBES = 96
"""Probes of a calibration on rods: four for each coefficient of a quadratic in five coordinates."""
RECENT = 16
"""Transitions of one update: about those of the last episode, in about the time of one decision."""
_TRUSTED, _TRUSTED_OF_ANOTHER = 1.5, 4.0
"""Factors by which a model in use may be off. With 4, a rod's stiffness falls to a rope's, a fifth, in 3 pushes."""

if TYPE_CHECKING:
    from app.calibration.fit import FitSettings
    from app.core.messages import Model, Parameter, Transition
    from app.core.motion import Motion
    from app.core.types import Centreline, Points, ToolPose
    from app.jobs.apparatus_compensation import Correction
    from app.jobs.jit_cache import Calibrated
    from app.planner.search.plan import Plan
    from app.planner.search.request import Actions, Ahead, Ways


def plan(
    task: str,
    preset: str,
    observed: Points,
    goal: Points,
    model: Model,
    seed: int,
    site: Site | None = None,
    tool: ToolPose | None = None,
    method: Method = DIPAC,
    rejected: Ways = (),
    near: Centreline | None = None,
    orientation: Orientation = UNKNOWN,
    remainder: Actions | None = None,
    ahead: Ahead | None = None,
) -> Plan:
    """Decide on the next action for the object that the cameras say is at `observed` (N, 3) [m].

    The model is what the simulation runs with. What it says of cameras and arm is allowed for: the plan is made for
    the object where it is, its motion is what to tell the arm, and what it predicts is what the cameras will show.
    `goal` (M, 3) [m] is where the object shall truly be; `tool`, where the tool is: None for actions that begin
    anywhere; `method`, how it is decided; `rejected`, tool paths of first actions that somebody does not want: the plan
    is another one while there is one; `near`, where the plan before predicted a rope's nodes, if the object is as its
    motion left it; `orientation`, what is known of its ends; `remainder`, what that plan was to go on with (L, A);
    `ahead`, a plan made for where the object was predicted to lie now, taken where that came true and where it holds.
    Raises PlanningError where no branch stays finite, and leaves a dump of one that did not; UsageError for an unknown
    task or preset.
    """
    from app.jobs import jit_cache, rope_orientation
    from app.planner.search.request import PlanRequest
    from app.tasks import load

    known = load(task)
    if known.perception.held is not None:  # A drop that ran off the grid would be the end of every branch.
        observed = known.scene.clip_to_grid(observed)
    where, allowed_for = site or Site(), correction_of(model)
    planner = jit_cache.planner(task, preset, jit_cache.phi_of(model), method, where.limits.confines)
    search = getattr(planner, "search", None)
    if ahead is not None and not ahead.came_true(observed):
        ahead = None
    if ahead is not None and search is not None:
        from app.planner.search.ahead import AheadPlanner

        planner = AheadPlanner(planner=planner, search=search)
    x = allowed_for.unproject(observed, tool) if allowed_for else observed
    phi = rope_orientation.oriented_phi(model, x, orientation, near)
    request = PlanRequest(
        observed=observed,
        goal=goal,
        phi=phi,
        seed=seed,
        site=where,
        tool=tool,
        rejected=rejected,
        near=near,
        remainder=remainder if method.continuing else None,
        ahead=ahead,
    )
    try:
        return allowed_for.plan(planner, request) if allowed_for else planner(request)
    except PlanningError as error:
        if search is None:  # A planner without a tree has simulated nothing.
            raise
        from app.jobs import failures

        true = allowed_for.true_request(request) if allowed_for else request
        raise PlanningError(f"{error}{failures.of_plan(task, search, true)}") from None


def plan_of_suggestion(
    task: str,
    observed: Points,
    goal: Points,
    model: Model,
    asked: Motion,
    site: Site | None = None,
    near: Centreline | None = None,
    orientation: Orientation = UNKNOWN,
    tool: ToolPose | None = None,
) -> Plan | str:
    """`asked`, a motion that discovery asks for, as a plan of one branch for the object at `observed` (N, 3) [m].

    A push or a sweep keeps its direction, length and speed, and is moved to where the object is; a carry or a pour
    begins at the pose of the `tool`, which holds the object. Where it cannot begin yet, what it waits for is returned
    instead. The rest is as of `plan`. Raises PlanningError where the motion fits nowhere.
    """
    from app.jobs.suggestions.plan import SuggestedPlanner

    return SuggestedPlanner(task=task, model=model, goal=goal, site=site or Site(), tool=tool).plan(
        asked, observed, near, orientation
    )


def track_orientation(task: str, orientation: Orientation, transition: Transition, model: Model) -> Orientation:
    """The belief after `transition` about which end of the object is the model's first (see `rope_orientation`)."""
    from app.jobs import rope_orientation

    if allowed_for := correction_of(model):
        transition = allowed_for.transition(transition)
    return rope_orientation.track_orientation(task, orientation, transition, model)


def calibrate(
    task: str, preset: str, transitions: Sequence[Transition], model: Model, site: Site | None = None
) -> Model:
    """The next version of the model, fitted by gradient to all the transitions, from `model` until it settles.

    Where transitions cannot be predicted, the log names a dump of one. Raises SimulationError where none can be,
    UsageError where there are no transitions, and of rods RecordingError where they cannot tell anything.
    """
    return calibration(task, preset, transitions, model, site).model


def calibration(
    task: str, preset: str, transitions: Sequence[Transition], model: Model, site: Site | None = None
) -> Calibrated:
    """As `calibrate`, with every trial on the way; of rods also the tool's offset, and checks of the data.

    Raises RecordingError where nothing can be learned from the transitions.
    """
    return _fit_model(task, preset, transitions, model, _settings_of(task), site or Site(), offline=True)


def _settings_of(task: str) -> FitSettings:
    """Settings with intervals from probes for rods, of which a push takes a millisecond."""
    from app.calibration.fit import FitSettings
    from app.tasks import load

    return FitSettings(probes=_PROBES if load(task).dynamics == "rods" else 0)


def update(task: str, preset: str, transitions: Sequence[Transition], model: Model, site: Site | None = None) -> Model:
    """As `calibrate`, in the background of an episode: two trial steps on the newest transitions.

    The model in use is trusted to a factor of 1.5, so that one odd transition does not throw it off; one that was
    calibrated on another object, to a factor of 4, so that a handful of transitions makes it this one's.
    """
    from app.calibration.fit import FitSettings
    from app.tasks import load

    trust_factor = _TRUSTED if load(task).training_variant is None else _TRUSTED_OF_ANOTHER
    settings = FitSettings(steps=2, trust_factor=trust_factor)
    return _fit_model(task, preset, transitions[-RECENT:], model, settings, site or Site()).model


def _fit_model(
    task: str,
    preset: str,
    transitions: Sequence[Transition],
    model: Model,
    settings: FitSettings,
    site: Site,
    *,
    offline: bool = False,
) -> Calibrated:
    from app.jobs import failures, jit_cache
    from app.sim.model.params import with_orientation

    if allowed_for := correction_of(model):
        transitions = [allowed_for.transition(transition) for transition in transitions]
    try:
        way = jit_cache.calibrated_from_recordings if offline else jit_cache.calibrate_model
        found = way(task, preset, transitions, model, settings)
    except SimulationError as error:
        left = failures.of_transitions(task, transitions, with_orientation(jit_cache.phi_of(model), 0.0), site)
        raise SimulationError(f"{error}{left}") from None
    lost, phi = [transitions[index] for index in found.lost], with_orientation(jit_cache.phi_of(found.model), 0.0)
    if left := failures.of_transitions(task, lost, phi, site):
        _log.warning("A transition of the calibration is not predicted.%s", left)
    return found


def doubt(task: str, observed: Points, near: Centreline | None = None) -> str:
    """Reason to doubt the task's dynamics for the object as observed, in a sentence; empty for none.

    `observed` (N, 3) [m]. Rods doubt ropes that cross themselves, are lifted or partly hidden, or whose strands touch
    so that neither the cloud nor the prediction that it is `near` tells their order.
    """
    from app.sim.rods.geometry.rope_cloud import RopeShape
    from app.sim.rods.geometry.verdict import doubt
    from app.tasks import load

    known = load(task)
    if known.dynamics != "rods" or known.rods is None:
        return ""
    scene = known.rods.scene
    return doubt(observed, RopeShape(count=scene.nodes, rest_m=scene.rest_m, radius_m=scene.radius_m), near)


def choose_preset() -> str:
    """The preset for the best device that JAX finds on this machine."""
    import jax

    return "cpu" if jax.default_backend() == "cpu" else "gpu"


def nominal_model(task: str, priors: Sequence[Parameter] = ()) -> Model:
    """Version 0: the task's own guess of its parameters, and instead of it `priors`, where there are any."""
    from app.jobs import jit_cache

    return jit_cache.nominal_model(task, priors)


def uncalibrated_model(task: str) -> Model:
    """Model of the task's simulator without any demonstration."""
    from app.jobs import jit_cache

    return jit_cache.uncalibrated_model(task)


def check_model(model: Model) -> None:
    """Raises ParameterError where a parameter is missing, unknown, non-finite or outside its range."""
    from app.jobs import extended

    extended.check(model)


def ends_of_ranges(model: Model) -> dict[str, str]:
    """In words, the estimates (those with an interval) at an end of their range, by the parameters' names."""
    from app.jobs import extended

    return extended.ends_of_ranges(model)


def planner_needs(model: Model) -> tuple[str, ...]:
    """In words, features that a planner for this model is compiled for: effects by first parameter; a stiff rope."""
    from app.jobs import jit_cache

    effects, stiff = jit_cache.needs(model.task, jit_cache.phi_of(model))
    return tuple(effect.parameters[0].name for effect in effects) + (("a stiff rope",) if stiff else ())


def true_positions(observed: Points, model: Model, tool: ToolPose | None = None) -> Points:
    """The object as it truly is, where the cameras say that it is at `observed` (N, 3) [m]: see `Correction.unproject`.

    `tool`: its pose, by the arm's own account.
    """
    allowed_for = correction_of(model)
    return allowed_for.unproject(observed, tool) if allowed_for else observed


def shown_goal(goal: Points, model: Model) -> Points:
    """The goal (M, 3) [m] in the frame of the cameras: their view of an object that is there."""
    allowed_for = correction_of(model)
    return allowed_for.observe(goal) if allowed_for else goal


def correction_of(model: Model) -> Correction | None:
    """The model's correction of cameras and arm; None if it has none."""
    if not model.apparatus:
        return None
    from app.jobs.apparatus_compensation import correction

    return correction(model)


def warm_up_stages(
    task: str,
    preset: str,
    model: Model | None = None,
    method: Method = DIPAC,
    site: Site | None = None,
    *,
    learning: bool = False,
) -> list[str]:
    """Descriptions of the compilation steps before the first decision, in order, for people who wait.

    The nominal model is used if none is given. `learning`: the process is to `update` models, too, which compiles more.
    """
    from app.jobs.stages import stages

    confines = (site or Site()).limits.confines
    return [stage.name for stage in stages(task, preset, model, method, confines, learning=learning)]


def warm_up_stage(
    task: str,
    preset: str,
    index: int,
    model: Model | None = None,
    method: Method = DIPAC,
    site: Site | None = None,
    *,
    learning: bool = False,
) -> None:
    """Compile stage `index` of `warm_up_stages`, in the process that is going to plan."""
    from app.jobs.stages import stages

    stages(task, preset, model, method, (site or Site()).limits.confines, learning=learning)[index].run()
