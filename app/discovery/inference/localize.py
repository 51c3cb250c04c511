"""Localisation of the causes that act at a place: a lattice over all that the object swept, refined where it fits best.

Every node of the lattice is a hypothesis. All are simulated once, from the object as it was seen, in the pushes that
came near; each is scored by its Bayes factor against the nuisances alone, the noise being that of the nominal fit. The
screening then asks about the best few with all beginnings. What the best of many gains by chance is given back as
`Located.cost`: the evidence of a cause is the mean over the whole lattice, of which all but the kept nodes add nothing.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

from app.discovery.dataset.model_under_test import Cause, Theta
from app.discovery.inference.mixed_effects import fit_mixed_effects, forms_of
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step, residuals, steps_of
from app.discovery.residuals.simulation_batch import SimulationBatch

KEPT: Final = 3
"""Places of a cause that the screening asks about."""
_FELT_EVERYWHERE_M: Final = 0.06
"""Spacing of the lattice of a cause without an end to its reach; of others it is half of that."""
_LEAST_PUSHES: Final = 2
"""Pushes that have to come near a node for it to be one."""
_MOVED_M: Final = 3e-3
_REFINED: Final = 2
"""Nodes around which places half a spacing away are tried."""
_AROUND: Final = np.array([(x, y) for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5) if x or y])


class Located(NamedTuple):
    """Places (S, 2) [m] at which a cause is likeliest, and the logarithm of nodes that were tried for each of them."""

    places: Float64[np.ndarray, "S 2"]
    cost: float


def likeliest_places(
    predictor: Predictor,
    trials: SimulationBatch,
    about: Theta,
    names: Sequence[str],
    nuisances: Sequence[Step],
    prior: Prior,
) -> Mapping[str, Located]:
    """The likeliest places of the causes of these `names`. `prior`: of the `nuisances`, about the nominal model."""
    causes = [predictor.catalogue.cause(name) for name in names]
    swept = _sweep(trials)
    lattices = {cause.name: lattice(swept, _spacing_m(cause)) for cause in causes}
    coarse = _evidences(predictor, trials, about, nuisances, prior, lattices)
    finer = {cause.name: _around(lattices[cause.name], coarse[cause.name], _spacing_m(cause)) for cause in causes}
    fine = _evidences(predictor, trials, about, nuisances, prior, finer)
    found = dict[str, Located]()
    for cause in causes:
        name, apart_m = cause.name, 0.7 * _spacing_m(cause)
        places, evidence = np.concatenate([lattices[name], finer[name]]), np.concatenate([coarse[name], fine[name]])
        kept = _best(places, evidence, KEPT, apart_m)
        found[name] = Located(places[kept], float(np.log(max(len(lattices[name]) / max(len(kept), 1), 1.0))))
    return found


def _spacing_m(cause: Cause) -> float:
    return _FELT_EVERYWHERE_M if cause.reach_m is None else cause.reach_m / 2


def _sweep(trials: SimulationBatch) -> list[Float64[np.ndarray, "M 2"]]:
    """Places at which something of the object moved in each push, as it was seen before, during and after."""
    found = list[Float64[np.ndarray, "M 2"]]()
    for k, push in enumerate(trials.study.pushes):
        before = push.before.points[:, :2].astype(np.float64)
        later = [trials.observed.after[k][:, :2].astype(np.float64)]
        if trials.has_during[k]:
            later.append(trials.observed.during[k][:, :2].astype(np.float64))
        left = _farther(before, later[0])
        found.append(np.concatenate([left, *(_farther(cloud, before) for cloud in later)]))
    return found


def _farther(cloud: Float64[np.ndarray, "N 2"], other: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, "M 2"]:
    """Points of a cloud that are not where the other has any."""
    return cloud[np.asarray(KDTree(other).query(cloud)[0]) > _MOVED_M]


def lattice(swept: Sequence[Float64[np.ndarray, "M 2"]], spacing_m: float) -> Float64[np.ndarray, "S 2"]:
    """Nodes near which something moved in two pushes or more."""
    cells = [np.unique(np.rint(places / spacing_m).astype(int), axis=0) for places in swept if len(places)]
    if not cells:
        return np.zeros((0, 2))
    nodes, pushes = np.unique(np.concatenate(cells), axis=0, return_counts=True)
    return nodes[pushes >= _LEAST_PUSHES] * spacing_m


def _around(
    places: Float64[np.ndarray, "S 2"], evidence: Float64[np.ndarray, " S"], spacing_m: float
) -> Float64[np.ndarray, "F 2"]:
    """Places half a spacing from the likeliest."""
    best = places[_best(places, evidence, _REFINED, spacing_m)]
    return (best[:, None] + spacing_m * _AROUND).reshape(-1, 2)


def _best(
    places: Float64[np.ndarray, "S 2"], evidence: Float64[np.ndarray, " S"], count: int, apart_m: float
) -> list[int]:
    """The likeliest places, none nearer to a likelier one than that."""
    found = list[int]()
    for index in np.argsort(-evidence).tolist():
        if all(np.linalg.norm(places[index] - places[other]) >= apart_m for other in found):
            found.append(index)
        if len(found) == count:
            break
    return found


def _evidences(
    predictor: Predictor,
    trials: SimulationBatch,
    about: Theta,
    nuisances: Sequence[Step],
    prior: Prior,
    places: Mapping[str, Float64[np.ndarray, "S 2"]],
) -> dict[str, Float64[np.ndarray, " S"]]:
    """The logarithm of the Bayes factor of each cause at each of its places."""
    asked = [step for step in steps_of(predictor.catalogue, (), places) if step.cause in places]
    data = residuals(predictor, trials, about, [*nuisances, *asked], replicas=0, starts=1)
    logs = log_bayes_of_each(data, prior, [step.sides == 1 for step in asked])
    owners = np.array([step.cause for step in asked])
    return {cause: logs[owners == cause] for cause in places}


def log_bayes_of_each(data: Residuals, prior: Prior, one_sided: Sequence[bool]) -> Float64[np.ndarray, " S"]:
    """Log Bayes factors (S,) of the columns behind those of `prior`: each alone, of a typical size.

    The score test's efficient score and information (Cox and Hinkley 1974, "Theoretical Statistics", 9.3), with a unit
    normal prior of the size integrated out. A column of one side that would have to be negative has no evidence.
    """
    count = len(prior.variance)
    known = Residuals(
        r=data.r, J=data.J[:, :, :count], spread=data.spread, known=data.known, episode=data.episode, blocks=data.blocks
    )
    fit = fit_mixed_effects(known, prior.variance, prior.mean)
    theta = np.concatenate([fit.theta, np.zeros(data.J.shape[2] - count)])
    forms = forms_of(data, theta, fit.covariances)
    A, left = forms.A.sum(0), forms.b.sum(0) - forms.A.sum(0) @ theta
    projection = np.linalg.solve(A[:count, :count] + np.diag(1 / prior.variance), A[:count, count:])
    score = left[count:] - left[:count] @ projection
    information = np.diag(A)[count:] - np.einsum("ij,ij->j", A[:count, count:], projection)
    score = np.where(one_sided, np.maximum(score, 0.0), score)
    return 0.5 * (score**2 / (information + 1) - np.log1p(np.maximum(information, 0.0)))
