"""Residuals of all pushes about a model, and how they depend on every parameter: secants over typical steps.

Parameters vary along the candidate axis, so that all slopes of all pushes are one batch of simulations. Secants and not
derivatives, because friction of the finger, viscosity and what has a threshold bend within that step.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.discovery.direct import direct_rows
from app.discovery.evidence import Residuals
from app.discovery.field import MODES, Basis, registered
from app.discovery.predict import Predictor, Seen, Trials
from app.discovery.subject import NUMERICS, Catalogue, Theta

_NUISANCE_STEP = 0.3
"""Of the calibrated parameters, in a logarithm."""
REPLICAS = 6
"""Simulations of each push from a start that is disturbed by the noise of the cameras."""


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


def steps_of(catalogue: Catalogue, calibrated: tuple[str, ...], places: Float64[np.ndarray, "S 2"]) -> list[Step]:
    """A step for each parameter that makes a cause, nuisances first. `places` [m]: where something might be."""
    steps = [Step(cause=name, column=catalogue.column(name), size=_NUISANCE_STEP, sides=2) for name in calibrated]
    for cause in catalogue.causes:
        switches, where = cause.columns[: cause.switches], cause.columns[cause.switches :]
        asked: list[tuple[tuple[int, float], ...]] = [()]
        if len(where) == 2:
            asked = [tuple(zip(where, place.tolist(), strict=True)) for place in places]
        for given in asked:
            for column in switches:
                spec = catalogue.specs[column]
                assert spec.typical is not None, spec.name
                size = spec.coordinate(spec.typical) - spec.coordinate(spec.nominal)
                one_sided = spec.nominal in (spec.low, spec.high) or cause.family == "numerics"
                steps.append(Step(cause=cause.name, column=column, size=size, sides=1 if one_sided else 2, given=given))
    return steps


def moved(catalogue: Catalogue, about: Theta, step: Step, share: float) -> Theta:
    """`about` with a share of a step added to it."""
    theta = about.copy()
    for column, value in step.given:
        theta[column] = value
    spec = catalogue.specs[step.column]
    theta[step.column] = spec.value(spec.coordinate(theta[step.column]) + share * step.size)
    return theta


def residuals(
    predictor: Predictor, trials: Trials, about: Theta, steps: list[Step], replicas: int = REPLICAS
) -> Residuals:
    """Residuals about a model, what each step changes, and how far a millimetre at the start goes."""
    catalogue = predictor.catalogue
    thetas = [about]
    for step in steps:
        if step.cause not in NUMERICS:
            thetas += [moved(catalogue, about, step, share) for share in ((1.0, -1.0) if step.sides == 2 else (1.0,))]
    found = predictor(trials, thetas)
    base = Seen(found.during[0], found.after[0])
    pairs, at = list[tuple[Seen, Seen | None]](), 1
    for step in steps:
        if step.cause in NUMERICS:
            other = predictor(trials, [about], scene=predictor.subject.numeric(step.cause))
            pairs.append((Seen(other.during[0], other.after[0]), None))
            continue
        down = Seen(found.during[at + 1], found.after[at + 1]) if step.sides == 2 else None
        pairs.append((Seen(found.during[at], found.after[at]), down))
        at += step.sides
    disturbed = [_single(predictor(trials.disturbed(seed), [about])) for seed in range(replicas)]
    clouds = _assembled(trials, base, pairs, disturbed)
    ends = [_ends(catalogue, about, step) for step in steps]
    direct = direct_rows(predictor, trials, about, ends)
    still = np.zeros((*direct.r.shape, clouds.spread.shape[2]))
    return Residuals(
        r=np.concatenate([clouds.r, direct.r], axis=1),
        J=np.concatenate([clouds.J, direct.J], axis=1),
        spread=np.concatenate([clouds.spread, still], axis=1),
        known=np.concatenate([clouds.known, direct.known], axis=1),
        episode=clouds.episode,
    )


def _ends(catalogue: Catalogue, about: Theta, step: Step) -> tuple[Theta, Theta]:
    """Two models a step apart: half a step to each side, or from the null upwards."""
    low, high = (-0.5, 0.5) if step.sides == 2 else (0.0, 1.0)
    return moved(catalogue, about, step, high), moved(catalogue, about, step, low)


def _single(found: Seen) -> Seen:
    return Seen(found.during[0], found.after[0])


def _assembled(trials: Trials, base: Seen, pairs: list[tuple[Seen, Seen | None]], replicas: list[Seen]) -> Residuals:
    """Amplitudes of the view during and after each push, in that order; 0 with no certainty for one nobody took."""
    count, width = len(trials), 2 * MODES
    r, known = np.zeros((count, 2 * width)), np.zeros((count, 2 * width), bool)
    J, spread = np.zeros((count, 2 * width, len(pairs))), np.zeros((count, 2 * width, len(replicas)))
    for view, name in enumerate(("during", "after")):
        rows = slice(view * width, (view + 1) * width)
        for k in range(count):
            predicted, observed = getattr(base, name)[k], getattr(trials.observed, name)[k]
            if (name == "during" and not trials.has_during[k]) or not np.isfinite(predicted).all():
                continue
            basis = Basis.along(predicted, trials.labels[k, :, 0])

            def change(seen: Seen, name: str = name, k: int = k, predicted: np.ndarray = predicted) -> np.ndarray:
                return (getattr(seen, name)[k] - predicted)[:, :2].astype(np.float64)

            up = np.stack([change(above) for above, _ in pairs])
            down = np.stack([-change(above) if below is None else change(below) for above, below in pairs])
            r[k, rows] = registered(predicted, observed, basis)
            J[k, rows] = basis.projected(np.nan_to_num((up - down) / 2)).T
            spread[k, rows] = basis.projected(np.nan_to_num(np.stack([change(seen) for seen in replicas]))).T
            known[k, rows] = True
    return Residuals(
        r=r,
        J=J,
        spread=spread,
        known=known,
        episode=np.array([push.episode for push in trials.study.pushes]),
    )
