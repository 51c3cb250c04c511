"""Compiled functions of a task, cached per process: simulator, planner and calibrator."""

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32
from scipy.spatial.transform import Rotation

from app.calibration.calibrate import Calibrator, ToolOffset, next_model, phi_of
from app.calibration.checks import check_better_than_no_motion, check_contact
from app.calibration.evidence import Advance as FromState
from app.calibration.evidence import Begin, ModelScorer, gather
from app.calibration.fit import Fit, FitSettings, Tried
from app.config import ANYWHERE, Confines
from app.core.errors import SimulationError
from app.core.messages import MessageId, Model, Parameter, Transition
from app.core.motion import TOOL_DOWN
from app.planner.base import Planner
from app.planner.method import DIPAC, Method
from app.planner.planner_factory import make_planner
from app.planner.search.tree import Advance, Part, TreeConfig
from app.sim.diagnosis.object_state import ObjectState
from app.sim.effect_composition import require_known
from app.sim.effects.base import Effect
from app.sim.model.params import PARAMETERS, acting, columns_of, index, with_orientation
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodSetting
from app.sim.rods.from_parameters import rod_columns, rod_physics
from app.sim.rods.rollout import make_rod_rollout
from app.sim.rods.state import RodStart, RodState
from app.sim.runtime.directions import find_directions
from app.sim.runtime.rollout import make_rollout
from app.sim.state import Setting, State
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.rods import RodDynamics

__all__ = ["advance", "calibrate_model", "nominal_model", "now", "phi_of", "planner", "search"]

FromRest = Callable[[Float[Array, "B P"], Float[Array, "B N 3"], Float[Array, "B T C"]], Float[Array, "B N 3"]]
"""Simulator of an observed object at rest: parameters, particles before, tool path -> particles after."""
_CHUNKS = {"mpm": 8, "rods": 16}
"""Transitions that are simulated at once. Sixteen rods take as long as one on a CPU."""
NOWHERE_M = (0.0, 0.0, 0.0)
"""Arbitrary middle of the cameras, for models without camera errors."""
_AT_END = 1e-3
"""Tolerance on the end of a range, in the logarithm."""
_STARTS = (0.25, 0.5, 0.75)
"""Initial stiffnesses of fits in the other range, as shares of it in the logarithm."""
_NOW = 0.5
"""The end of a session."""


@final
class Needs(NamedTuple):
    """Key of a simulator that is compiled for a model: effects that act, and whether its rod is of the stiff scene."""

    effects: tuple[Effect, ...] = ()
    stiff: bool = False


def needs(task: str, phi: Float32[np.ndarray, " P"], names: Collection[str] = ()) -> Needs:
    """The key for a model `phi`, of which the parameters `names` are estimated (`params.acting`)."""
    data, column = load(task), index("stiffness")
    usual, most = (data.parameters(stiff=stiff)[column].high for stiff in (False, None))
    return Needs(acting(phi, names), bool(most > usual and phi[column] > usual))


@lru_cache
def advance(task: str, particle_count: int, effects: tuple[Effect, ...] = (), stiff: bool = False) -> FromRest:
    """The task's simulator of one action on an object that is seen at rest, as `particle_count` particles."""
    end, begin = end_from_state(task, particle_count, effects, stiff), load(task).initial_state

    def from_rest(
        phi: Float[Array, "B P"], x: Float[Array, "B N 3"], tool: Float[Array, "B T C"]
    ) -> Float[Array, "B N 3"]:
        return end(phi, begin(x), tool)

    return from_rest


@lru_cache
def end_from_state(task: str, particle_count: int, effects: tuple[Effect, ...] = (), stiff: bool = False) -> FromState:
    """The same from a state, as the particles come to rest."""
    carry = action_simulator(task, particle_count, effects, stiff)

    def end(phi: Float[Array, "B P"], state: ObjectState, tool: Float[Array, "B T C"]) -> Float[Array, "B N 3"]:
        return carry(phi, state, tool).x

    return end


@lru_cache
def states_at_rest(task: str) -> Begin:
    """States of observed objects at rest, for use outside of compiled code, where a rope's order is found first."""
    begin = load(task).initial_state
    if not isinstance(begin, RodStart):
        return jax.jit(begin)

    def along(x: Float32[np.ndarray, "B N 3"]) -> RodState:
        return begin.state_at(x, begin.places(x))

    return along


@lru_cache
def action_simulator(task: str, particle_count: int, effects: tuple[Effect, ...] = (), stiff: bool = False) -> Advance:
    """The task's simulator of one action, from state to state: to rest, where the task's actions end at rest.

    See `moving`.
    """
    move, at_rest = moving(task, particle_count, effects, stiff), load(task).at_rest

    def carry(phi: Float[Array, "B P"], state: ObjectState, tool: Float[Array, "B T C"]) -> ObjectState:
        end = move(phi, state, tool, state.x)
        return end.resting() if at_rest else end

    return carry


@lru_cache
def moving(task: str, particle_count: int, effects: tuple[Effect, ...] = (), stiff: bool = False) -> Part:
    """The task's simulator of an action or a piece of one, from state to state as they are.

    Which way a slender object runs, and so its rest shape, is seen from the particles as the action began. It takes
    all of phi and heeds the nominal parameters and those of `effects`; see `params.acting`. What changes in the course
    of a session is as at its end. A rod's first end is its first node: parameters that are odd along it have the sign
    of that (`rope_orientation.oriented_phi`). Of other objects nobody knows where along them a particle is: effects
    that depend on that do nothing. `stiff`: of rods, that of `RodDynamics.stiff_scene`. Raises ParameterError, which
    names the parameters, for a model that needs effects that its engine lacks.
    """
    data = load(task)
    if data.dynamics == "rods":
        return _moving_rod(data, effects, stiff=stiff)
    known = tuple(effect for effect in effects if not effect.needs_orientation)
    require_known(known)
    simulate = make_rollout(data.scene, particle_count=data.scene.split(particle_count), effects=known)
    own = np.array(columns_of(known))

    def move(
        phi: Float[Array, "B P"], state: ObjectState, tool: Float[Array, "B T C"], began: Float[Array, "B N 3"]
    ) -> ObjectState:
        assert isinstance(state, State)
        setting = now(len(phi), particle_count)
        known = setting if began is state.x else find_directions(data.scene, setting, began)
        return simulate(phi[:, own], state, tool, known)

    return move


def _moving_rod(task: Task, effects: tuple[Effect, ...], *, stiff: bool) -> Part:
    """The same for a rope as a rod."""
    assert task.rods is not None
    rods = task.rods
    simulate = make_rod_rollout(rods.scene_for(stiff=stiff), effects)
    own = np.array(rod_columns(effects), int)

    def move(
        phi: Float[Array, "B P"], state: ObjectState, tool: Float[Array, "B T C"], began: Float[Array, "B N 3"]
    ) -> ObjectState:
        del began
        assert isinstance(state, RodState)
        return simulate(rod_physics(rods.scene, rods.physics, phi), state, tool, phi[:, own], rod_now(rods, len(phi)))

    return move


def rod_now(rods: RodDynamics, candidates: int) -> RodSetting:
    """Setting of an action on rods that is planned, as `now`; the first node is the first end."""
    along = jnp.tile(jnp.linspace(-1.0, 1.0, rods.scene.nodes), (candidates, 1))
    return RodSetting(material_coordinates=along, session_time=jnp.full(candidates, _NOW))


def now(candidates: int, particle_count: int) -> Setting:
    """Setting of an action that is planned: it comes after the session of the model."""
    return Setting.unknown(candidates, particle_count)._replace(time=jnp.full(candidates, _NOW))


def planner(
    task: str, preset: str, phi: Float32[np.ndarray, " P"], method: Method = DIPAC, confines: Confines = ANYWHERE
) -> Planner:
    """The task's planner, sized by the preset, for models that need the effects that `phi` does."""
    return _planner(task, preset, needs(task, phi), method, confines)


@lru_cache
def _planner(task: str, preset: str, needed: Needs, method: Method, confines: Confines) -> Planner:
    data, search = load(task), _search(task, preset, needed, confines)
    if method.policy is not None:
        search = replace(search, policy=method.policy, origin="learned")
    return make_planner(method, search, data.descent, data.preset(preset).gradient_steps)


def search(task: str, preset: str, phi: Float32[np.ndarray, " P"], confines: Confines = ANYWHERE) -> TreeConfig:
    """Tree search of the task's decisions, sized by the preset, for models that need the effects of `phi`."""
    return _search(task, preset, needs(task, phi), confines)


@lru_cache
def _search(task: str, preset: str, needed: Needs, confines: Confines) -> TreeConfig:
    data, size = load(task), load(task).preset(preset)
    return TreeConfig(
        space=data.actions,
        policy=data.policy,
        weights=replace(data.weights, keep_out=confines.keep_out, reach=confines.reach),
        advance=action_simulator(task, size.particle_count, *needed),
        begin=data.initial_state,
        branches=size.branches,
        depth=size.depth,
        descended=size.descended,
        redraws=size.redraws,
        policy_shares=size.policy_shares,
        part=moving(task, size.particle_count, *needed),
        at_rest=data.at_rest,
    )


def calibrator(task: str, preset: str, settings: FitSettings, phi: Float32[np.ndarray, " P"]) -> Calibrator:
    """The task's calibrator, for models that need the effects that `phi` does; of rods also of the tool's offset."""
    return _calibrator(task, preset, settings, needs(task, phi, load(task).calibrated))


@lru_cache
def _calibrator(task: str, preset: str, settings: FitSettings, needed: Needs) -> Calibrator:
    data = load(task)
    simulator = end_from_state(task, data.preset(preset).particle_count, *needed)
    predictor = ModelScorer(advance=simulator, begin=states_at_rest(task), chunk=_CHUNKS[data.dynamics])
    known = data.parameters(stiff=needed.stiff)
    specs = tuple(known[index(name)] for name in data.calibrated)
    return Calibrator(predictor=predictor, specs=specs, settings=settings, offset=_tool_offset(data))


def _tool_offset(task: Task) -> ToolOffset | None:
    """Axes of the tool's offset for a tool that points down, as discovery's `tcp_offset`; None for other than rods."""
    from app.discovery.sensor_actuator_errors.tcp_offset import EFFECT

    if task.dynamics != "rods" or task.rods is None:
        return None
    specs = tuple(spec for spec in EFFECT.parameters if spec.name in task.rods.tool_offset)
    down = Rotation.from_quat(TOOL_DOWN, scalar_first=True).as_matrix()
    columns = ["xyz".index(spec.name[-1]) for spec in specs]
    x, y = (tuple(down[row, columns].tolist()) for row in (0, 1))
    return ToolOffset(specs=specs, axes=(x, y))


@final
class Calibrated(NamedTuple):
    """The next version of a model, the indices of the transitions that it does not predict, and how it was found.

    `trials`: values of `names` and their loss, from the start; of a rod that another simulator was tried for, of both.
    """

    model: Model
    lost: tuple[int, ...]
    names: tuple[str, ...]
    trials: tuple[Tried, ...]


def calibrate_model(
    task: str, preset: str, transitions: Sequence[Transition], model: Model, settings: FitSettings
) -> Calibrated:
    """The next version of `model`, fitted to all the transitions; what is odd along the object is 0 meanwhile."""
    evidence = gather(transitions, load(task).actions.measured_path)
    even = with_orientation(phi_of(model), 0.0)
    fitter, found = _fit_across_ranges(task, preset, settings, even, lambda by, phi: by.fit(evidence, phi))
    new = next_model(model, found, fitter.names, transitions)
    return Calibrated(new, found.lost, fitter.names, found.trials)


def calibrated_from_recordings(
    task: str, preset: str, transitions: Sequence[Transition], model: Model, settings: FitSettings
) -> Calibrated:
    """As `calibrate_model`; of rods also the tool's offset, as far as an interval tells it from none.

    Raises RecordingError where the transitions of a rod tell nothing (`app.calibration.checks`).
    """
    data, phi = load(task), with_orientation(phi_of(model), 0.0)
    if _tool_offset(data) is None:
        return calibrate_model(task, preset, transitions, model, settings)
    evidence = gather(transitions, data.actions.measured_path)
    check_contact(evidence, data.finger.radius_m + data.finger.half_width_m + data.rope.radius_m)
    fitter, found = _fit_across_ranges(task, preset, settings, phi, lambda by, phi: by.fit_with_offset(evidence, phi))
    offset, first = fitter.offset.specs if fitter.offset else (), len(fitter.names)
    if not ((found.low > 0) | (found.high < 0))[first:].any():
        offset = ()
        fitter, found = _fit_across_ranges(task, preset, settings, phi, lambda by, phi: by.fit(evidence, phi))
    check_better_than_no_motion(found.losses_m2, evidence)
    new = next_model(model, found, fitter.names, transitions, offset)
    if new.apparatus and not new.extension.camera_m:
        new = replace(new, extension=replace(new.extension, camera_m=NOWHERE_M))
    return Calibrated(new, found.lost, (*fitter.names, *(spec.name for spec in offset)), found.trials)


_FitFrom = Callable[[Calibrator, Float32[np.ndarray, " P"]], Fit]
"""A fit by a calibrator from a model phi."""


def _fit_across_ranges(
    task: str, preset: str, settings: FitSettings, phi: Float32[np.ndarray, " P"], fit: _FitFrom
) -> tuple[Calibrator, Fit]:
    """The fit from a model `phi`, and the calibrator that made it.

    A rod's stiffness ends where one simulator's range adjoins the other's (`Task.parameters`). Where nobody vouches for
    the start, a fit that ends there is made anew in the other range, and the better one counts. A model that is trusted
    keeps its simulator. An interval that goes so far goes to the end of the whole range: what is beyond was not tried.
    """
    fitter, column, stiff = calibrator(task, preset, settings, phi), index("stiffness"), needs(task, phi).stiff
    found = fit(fitter, phi)
    here, there, whole = (load(task).parameters(stiff=kind)[column] for kind in (stiff, not stiff, None))
    if here == whole or here not in fitter.specs:
        return fitter, found
    number = fitter.specs.index(here)
    if _borders(here, there, found.values[number]) and np.isinf(settings.trust_factor):
        best = _best_within(there, task, preset, settings, phi, fit)
        if best and len(best.lost) <= len(found.lost) and best.loss_m2 < found.loss_m2:
            start = phi.copy()
            start[[index(name) for name in fitter.names]] = best.values[: len(fitter.names)]
            fitter, here, there = calibrator(task, preset, settings, start), there, here
            found = replace(fit(fitter, start), trials=(*found.trials, *best.trials))
    low, high = found.low.copy(), found.high.copy()
    low[number] = whole.low if _borders(here, there, low[number]) else low[number]
    high[number] = whole.high if _borders(here, there, high[number]) else high[number]
    return fitter, replace(found, low=low, high=high)


def _best_within(
    stiffness: ParameterSpec,
    task: str,
    preset: str,
    settings: FitSettings,
    phi: Float32[np.ndarray, " P"],
    fit: _FitFrom,
) -> Fit | None:
    """The best fit of several that begin within a range of stiffness, without probes; None where none predicts a thing.

    Friction has made up for what the rod of the other range was too limp or too stiff for: descent from there stays.
    """
    found, start = list[Fit](), phi.copy()
    for share in _STARTS:
        start[index("stiffness")] = stiffness.low ** (1 - share) * stiffness.high**share
        with suppress(SimulationError):
            found.append(fit(calibrator(task, preset, replace(settings, probes=0), start), start))
    return min(found, key=lambda each: (len(each.lost), each.loss_m2), default=None)


def _borders(here: ParameterSpec, there: ParameterSpec, value: float) -> bool:
    """True if a value in the range `here` is at the end that adjoins the range `there`."""
    end = here.high if there.low >= here.high else here.low
    return bool(abs(here.coordinate(value) - here.coordinate(end)) < _AT_END)


def nominal_model(task: str, priors: Sequence[Parameter] = ()) -> Model:
    """Version 0, with the values and intervals of `priors`. Its time is 0, before any observation."""
    said = {prior.name: prior for prior in priors}
    known = tuple(
        Parameter(name=spec.name, value=value, unit=spec.unit, low=value, high=value)
        for spec, value in zip(PARAMETERS, _nominal_values(load(task)), strict=True)
    )
    return Model(
        id=MessageId(f"model-{'prior' if said else 'nominal'}-{task}"),
        time_s=0.0,
        version=0,
        task=task,
        parameters=tuple(replace(said[each.name], unit=each.unit) if each.name in said else each for each in known),
    )


def uncalibrated_model(task: str) -> Model:
    """Model of the task's simulator without any demonstration: its own defaults for what is calibrated.

    The task's nominal values of those came from fits to the object's behaviour.
    """
    known = nominal_model(task)
    defaults = {spec.name: spec.nominal for spec in PARAMETERS if spec.name in load(task).calibrated}
    parameters = tuple(
        replace(each, **dict.fromkeys(("value", "low", "high"), defaults[each.name])) if each.name in defaults else each
        for each in known.parameters
    )
    return replace(known, id=MessageId(f"model-uncalibrated-{task}"), parameters=parameters)


def _nominal_values(task: Task) -> list[float]:
    return [task.nominal.get(spec.name, spec.nominal) for spec in PARAMETERS]
