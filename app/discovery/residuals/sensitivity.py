"""Residuals of all pushes about a model, and how they depend on every parameter: secants over typical steps.

Parameters vary along the candidate axis, so that all slopes of all pushes are one batch of simulations. Secants and not
derivatives, because friction of the finger, viscosity and what has a threshold bend within that step.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.core.types import Points
from app.discovery.dataset.model_under_test import Catalogue, Cause, Theta
from app.discovery.residuals.direct_measurements import Change, best_by_log, direct_blocks, direct_rows
from app.discovery.residuals.poured_rows import assemble_contents
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.residuals.simulation_batch import PushParticles, SimulationBatch, View
from app.discovery.sensor_actuator_errors.base import Apparatus
from app.sim.model.numerics import NUMERICS

Way: TypeAlias = tuple[str, tuple[tuple[int, float], ...]]
"""A cause, with the place, or the other values, that it is asked about with."""

_NOWHERE = np.zeros((0, 2))
_NUISANCE_STEP = 0.3
"""Step of the calibrated parameters, in the logarithm."""
_WAYS = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
"""Shares of the range of a parameter that says when or how an effect acts."""
_TOLD_SIZES = (0.125, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
"""Sizes in steps, of which that which fits the arm's log best is the secant's."""
REPLICAS = 6
"""Simulations of each push from a start that is disturbed by the noise of the cameras."""
_POUR_REPLICAS = 3
"""The same of pours, which depend on little of where particles begin."""
STARTS = 4
"""Beginnings of each push of an ensemble: as it was seen, and as the cameras may have missed it."""
_ROD_ERRING = 0.15
"""Error of the simulator of rods in each push, as a share of a step of every effect that changes the simulation: the
value that makes 49 recordings without an effect most likely. Of material points see `ObjectTraits.errs_by`."""


@final
@dataclass(frozen=True, kw_only=True)
class Step:
    """A direction in which the model is changed: to a value of one parameter, others being held at `given`.

    What has a place is asked about at several: `given` holds where. `sides`: 2 for a central difference, 1 where the
    null is an end of the range.
    """

    cause: str
    column: int
    size: float
    sides: int
    given: tuple[tuple[int, float], ...] = ()


Places: TypeAlias = Mapping[str, Float64[np.ndarray, "S 2"]]
"""Candidate places [m] of each cause that has one."""


def steps_of(catalogue: Catalogue, calibrated: Sequence[str], places: Places) -> list[Step]:
    """A step for each parameter that makes a cause, nuisances first; of a cause with a place one for each of them."""
    steps = [Step(cause=name, column=catalogue.column(name), size=_NUISANCE_STEP, sides=2) for name in calibrated]
    for cause in catalogue.causes:
        for given in _trial_values(catalogue, cause, places.get(cause.name, _NOWHERE)):
            steps += [switch_of(catalogue, cause, column, given) for column in cause.columns[: cause.switches]]
    return steps


def _trial_values(
    catalogue: Catalogue, cause: Cause, places: Float64[np.ndarray, "S 2"]
) -> list[tuple[tuple[int, float], ...]]:
    """Places, times or shapes at which a cause is asked about: values of the parameters that do not make it vanish."""
    others = cause.columns[cause.switches :]
    if cause.placed:
        return [tuple(zip(others, place.tolist(), strict=True)) for place in places]
    if not others:
        return [()]
    ways = list[tuple[tuple[int, float], ...]]()
    for share in _WAYS:
        specs = [(column, catalogue.specs[column]) for column in others]
        ends = [(column, spec, spec.coordinate(spec.low), spec.coordinate(spec.high)) for column, spec in specs]
        ways.append(tuple((column, spec.value(low + share * (high - low))) for column, spec, low, high in ends))
    return ways


def switch_of(catalogue: Catalogue, cause: Cause, column: int, given: tuple[tuple[int, float], ...] = ()) -> Step:
    """The step from a parameter's null to its typical value."""
    spec = catalogue.specs[column]
    assert spec.typical is not None, spec.name
    size = spec.coordinate(spec.typical) - spec.coordinate(spec.nominal)
    one_sided = spec.nominal in (spec.low, spec.high)
    return Step(cause=cause.name, column=column, size=size, sides=1 if one_sided else 2, given=given)


def apply_step(catalogue: Catalogue, about: Theta, step: Step, share: float) -> Theta:
    """`about` with a share of a step added to it."""
    theta = about.copy()
    for column, value in step.given:
        theta[column] = value
    spec = catalogue.specs[step.column]
    theta[step.column] = spec.value(spec.coordinate(theta[step.column]) + share * step.size)
    return theta


def residuals(
    predictor: Predictor,
    trials: SimulationBatch,
    about: Theta,
    steps: Sequence[Step],
    replicas: int = REPLICAS,
    starts: int = STARTS,
) -> Residuals:
    """Residuals about a model, their slopes for each step, and random effects of each push.

    That is what the noise of the cameras at its start does, and a share of every step of what is simulated. Of rods
    and of pieces all of it is the mean over so many `starts`, which are the same for every model: a push that is
    chaotic says little.
    """
    catalogue = predictor.catalogue
    changes = [secant_of(predictor, trials, about, step) for step in steps]
    beginnings = [trials]
    if predictor.subject.is_ensemble:
        beginnings += [trials.with_noise(seed) for seed in range(starts - 1)]
    runs = [_simulate(predictor, beginning, about, steps, changes) for beginning in beginnings]
    base, displaced = _mean_of(runs) if trials.bowls is None else (runs[0][0], [])
    if trials.bowls is not None:
        replicas = min(replicas, _POUR_REPLICAS)
    if not replicas or len(beginnings) > 1:
        disturbed = [one for one, _ in runs][: replicas and starts]
    else:
        disturbed = [_single(predictor(trials.with_noise(seed), [about])) for seed in range(replicas)]
    apart = [change.apart for change in changes]
    if trials.bowls is None:
        in_cameras = _columns_of(catalogue, lambda effect: effect.see is not None)
        seen = [number for number, step in enumerate(steps) if step.column in in_cameras]
        clouds = _assemble(trials, base, displaced, apart, disturbed, seen)
    else:
        clouds = assemble_contents(trials, trials.bowls, base, runs[0][1], apart, disturbed)
    direct = direct_rows(predictor, trials, about, changes)
    spread = np.concatenate([clouds.spread, clouds.J * erring(catalogue, steps)], axis=2)
    still = np.zeros((*direct.r.shape, spread.shape[2]))
    return Residuals(
        r=np.concatenate([clouds.r, direct.r], axis=1),
        J=np.concatenate([clouds.J, direct.J], axis=1),
        spread=np.concatenate([spread, still], axis=1),
        known=np.concatenate([clouds.known, direct.known], axis=1),
        episode=clouds.episode,
        blocks=(*clouds.blocks, *direct_blocks(clouds.r.shape[1])),
    )


def erring(catalogue: Catalogue, steps: Sequence[Step]) -> Float64[np.ndarray, " P"]:
    """The share of each step by which the simulator errs in a push; less of each where several ways are asked about.

    Of ropes that is what physics do. What a paddle does to pieces it errs about as well: one that is 4 mm higher leaves
    some of them behind in the simulation, and none in the world.
    """
    apparatus = () if catalogue.kind.errs_with_tool else ("sensing", "actuation")
    outside = {cause.name for cause in catalogue.causes if cause.family in apparatus}
    asked = Counter((step.cause, step.column) for step in steps)
    ways = np.array([asked[step.cause, step.column] for step in steps], np.float64)
    simulated = np.array([step.cause not in outside for step in steps], np.float64)
    return (_ROD_ERRING if catalogue.rods else catalogue.kind.errs_by) * simulated / np.sqrt(ways)


def change_of(catalogue: Catalogue, about: Theta, step: Step) -> Change:
    """The models at a step's ends; they may be less far apart than it asks, as ranges end somewhere."""
    here = apply_step(catalogue, about, step, 0.0)
    up = apply_step(catalogue, about, step, 1.0)
    down = apply_step(catalogue, about, step, -1.0) if step.sides == 2 else here
    return Change(up, down, apart(catalogue, down, up, step))


def secant_of(predictor: Predictor, trials: SimulationBatch, about: Theta, step: Step) -> Change:
    """The change by which a step's slope is measured.

    An error that the arm's own log tells needs no simulation, and is not linear: a delay of two steps does not look
    like twice one of one step, but like a lag. Its slope is the secant to the size that fits the log best.
    """
    catalogue = predictor.catalogue
    usual = change_of(catalogue, about, step)
    at_null = about[step.column] == catalogue.specs[step.column].nominal
    if (
        step.column not in _columns_of(catalogue, lambda effect: effect.told)  # The arm itself measures these.
        or not at_null
        or any(push.measured is None for push in trials.study.pushes)
    ):
        return usual
    here, signs = apply_step(catalogue, about, step, 0.0), (1.0, -1.0)[: step.sides]
    ends = [apply_step(catalogue, about, step, sign * size) for sign in signs for size in _TOLD_SIZES]
    ends = [end for end in ends if end[step.column] != here[step.column]]
    if not ends:
        return usual
    end = ends[best_by_log(predictor, trials, ends)]
    far = apart(catalogue, here, end, step)
    return Change(end, here, far) if far > 0 else Change(here, end, -far)


def _columns_of(catalogue: Catalogue, chosen: Callable[[Apparatus], bool]) -> frozenset[int]:
    """Columns of those errors of cameras and arm that are chosen."""
    return frozenset(
        first + number
        for effect, first in catalogue.apparatus
        if chosen(effect)
        for number in range(len(effect.parameters))
    )


def apart(catalogue: Catalogue, one: Theta, other: Theta, step: Step) -> float:
    """Distance from one model to the other, in steps; less than requested at the end of a range."""
    spec = catalogue.specs[step.column]
    return (spec.coordinate(float(other[step.column])) - spec.coordinate(float(one[step.column]))) / step.size


def hypotheses_of(steps: Sequence[Step], columns: Iterable[int]) -> dict[Way, list[int]]:
    """Groups of columns of `steps` that belong to one hypothesis: one cause at one place, or of one shape."""
    found = dict[Way, list[int]]()
    for column in columns:
        found.setdefault((steps[column].cause, steps[column].given), []).append(column)
    return found


def _simulate(
    predictor: Predictor, trials: SimulationBatch, about: Theta, steps: Sequence[Step], changes: Sequence[Change]
) -> tuple[PushParticles, list[tuple[PushParticles, PushParticles]]]:
    """The model's own predictions, and those of both ends of every change. NaN where nothing changes."""
    thetas, where = [about], [np.ones(len(trials), bool)]
    at, felt = dict[tuple[int, int], int](), _effective_columns(predictor.catalogue, trials)
    for number, (step, change) in enumerate(zip(steps, changes, strict=True)):
        if _is_compiled(predictor, step):
            continue
        near = _within(predictor.catalogue, trials, step)
        for side, end in enumerate((change.up, change.down)):
            if (side == 0 or step.sides == 2) and (end != about)[felt].any() and change.apart > 0:
                at[number, side] = len(thetas)
                thetas.append(end)
                where.append(near)
    found = predictor(trials, thetas, where=np.stack(where))
    base = PushParticles(found.during[0], found.after[0])

    def end_of(number: int, step: Step, side: int) -> PushParticles:
        if _is_compiled(predictor, step) and side == 0:
            return _single(predictor(trials, [about], subject=predictor.subject.numeric(step.cause)))
        index = at.get((number, side), 0)
        return PushParticles(found.during[index], found.after[index])

    return base, [(end_of(n, step, 0), end_of(n, step, 1)) for n, step in enumerate(steps)]


def _is_compiled(predictor: Predictor, step: Step) -> bool:
    """True if a step is to another grid or contact of material points, which are compiled and no parameters."""
    return predictor.subject.rods is None and step.cause in NUMERICS


def _mean_of(
    runs: Sequence[tuple[PushParticles, list[tuple[PushParticles, PushParticles]]]],
) -> tuple[PushParticles, list[PushParticles]]:
    """The model's predictions, and their displacements by each change [m], as means over starts."""
    changes = [[_apart(*ends) for ends in run[1]] for run in runs]
    return _mean([run[0] for run in runs]), [_mean(change) for change in zip(*changes, strict=True)]


def _apart(up: PushParticles, down: PushParticles) -> PushParticles:
    return PushParticles(up.during - down.during, up.after - down.after)


def _mean(seen: Sequence[PushParticles]) -> PushParticles:
    """Mean over the simulations that reached their end; NaN if none did."""
    if len(seen) == 1:
        return seen[0]
    during, after = (_mean_of_known(np.stack(views)) for views in zip(*seen, strict=True))
    return PushParticles(during, after)


def _mean_of_known(views: Float32[np.ndarray, "D K N 3"]) -> Float32[np.ndarray, "K N 3"]:
    known = np.isfinite(views).all((2, 3), keepdims=True)
    total, count = np.where(known, views, 0.0).sum(0), known.sum(0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def _effective_columns(catalogue: Catalogue, trials: SimulationBatch) -> Bool[np.ndarray, " P"]:
    """Mask of the parameters that can change a prediction: not those of the arm that its own log contains."""
    felt = np.ones(len(catalogue.specs), bool)
    if all(push.measured is not None for push in trials.study.pushes):
        for effect, first in catalogue.apparatus:
            felt[first : first + len(effect.parameters)] = not effect.told
    return felt


def _within(catalogue: Catalogue, trials: SimulationBatch, step: Step) -> Bool[np.ndarray, " K"]:
    """Mask of the pushes in which the object came near the place of a step."""
    reach = next((cause.reach_m for cause in catalogue.causes if cause.name == step.cause), None)
    if reach is None or not step.given:
        return np.ones(len(trials), bool)
    place = np.array([value for _, value in step.given])
    clouds = ([push.before.points for push in trials.study.pushes], trials.observed.during, trials.observed.after)
    return np.any([[_nearest(cloud, place) < reach for cloud in views] for views in clouds], axis=0)


def _nearest(cloud: Points, place: Float64[np.ndarray, "2"]) -> float:
    return float(np.linalg.norm(cloud[:, :2] - place, axis=1).min())


def _single(found: PushParticles) -> PushParticles:
    return PushParticles(found.during[0], found.after[0])


def _assemble(
    trials: SimulationBatch,
    base: PushParticles,
    changes: Sequence[PushParticles],
    apart: Sequence[float],
    replicas: Sequence[PushParticles],
    seen: Sequence[int],
) -> Residuals:
    """Amplitudes of the view during and after each push, in that order; 0 and masked for a missing view.

    `seen`: changes of what cameras show alone.
    """
    count, width = len(trials), trials.modes
    r, known = np.zeros((count, 2 * width)), np.zeros((count, 2 * width), bool)
    J, spread = np.zeros((count, 2 * width, len(changes))), np.zeros((count, 2 * width, len(replicas)))
    scale = np.array([1 / steps if steps > 0 else 0.0 for steps in apart])
    views: tuple[View, View] = ("during", "after")
    for view, name in enumerate(views):
        rows = slice(view * width, (view + 1) * width)
        for k in range(count):
            predicted, observed = getattr(base, name)[k], getattr(trials.observed, name)[k]
            if (name == "during" and not trials.has_during[k]) or not np.isfinite(predicted).all():
                continue
            r[k, rows] = trials.gap(k, name, predicted, observed)
            if changes:
                displaced = np.nan_to_num(np.stack([getattr(each, name)[k] for each in changes]).astype(np.float64))
                J[k, rows] = trials.amplitudes(k, name, predicted, displaced, seen).T * scale
            if replicas:
                moved_on = np.stack([getattr(each, name)[k] - predicted for each in replicas]).astype(np.float64)
                ends_at = trials.amplitudes(k, name, predicted, np.nan_to_num(moved_on))
                spread[k, rows] = ends_at.T / np.sqrt(len(replicas))
            known[k, rows] = True
    return Residuals(
        r=r,
        J=J,
        spread=spread,
        known=known,
        episode=np.array([push.episode for push in trials.study.pushes]),
        blocks=(Block(slice(0, 2 * width), reversed=trials.signs_of_other_end),),
    )
