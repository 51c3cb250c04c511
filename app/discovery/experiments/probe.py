"""Design of experiments: the next push by its expected information about the missing cause.

A push is worth what it adds to the precision with which a cause's size would be known where the cause acts, in nats:
half the logarithm of the ratio of variances, with the nuisances, the other causes as far as they seem to act where
nothing is missing, and one rival in full projected out, under the noise that was learnt (Ds-optimality; Atkinson and
Cox 1974, "Planning experiments for discriminating between models"; Atkinson and Fedorov 1975). It is summed over all
pairs of a cause and a rival, nothing missing being one, weighted by how probable they are (Box and Hill 1967,
"Discrimination among mechanistic models"). Distances of predictions would ask for the most chaotic push; a logarithm
asks for what is not known yet.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final, Literal, TypeAlias, final

import numpy as np
from jaxtyping import Float64
from threadpoolctl import threadpool_limits

from app.core.dialogue import words
from app.discovery.dataset.model_under_test import Subject, Theta
from app.discovery.dataset.names import effect_name
from app.discovery.dataset.study import Study
from app.discovery.inference.calibration import calibration
from app.discovery.inference.decide import NAMED
from app.discovery.inference.mixed_effects import Covariances
from app.discovery.inference.screen import Screening, prior_of, refit, screen
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.direct_measurements import direct_blocks
from app.discovery.residuals.displacement_field import MODES
from app.discovery.residuals.forces import FORMULA
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import Step, hypotheses_of, steps_of
from app.discovery.residuals.simulation_batch import prepare

Stop: TypeAlias = Literal["named", "none left", "budget"]
NOTHING: Final = "nothing missing"

_RIVAL: Final = 0.01
"""Probability below which a cause is not worth a push."""
_SURVIVOR: Final = 0.05
"""Probability that no cause has where none is left."""
_EPISODES: Final = 3
"""Least number of episodes for a name: fewer could be chance."""
_UNKNOWN_M: Final = 1.5e-3
"""Noise of an amplitude before any is learnt: the median of what screenings of ropes learn."""
_NOTHING_FIRST: Final = 0.22
"""Probability of nothing missing before the first push, as in the studies that confidence is learnt from."""
_LISTED: Final = 3


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Belief:
    """All that the choice of a push needs of the pushes so far; S columns, each a step of a parameter from `about`.

    `information (S, S)`, `pull (S)`: of the log likelihood, half of theta A theta less b theta, as `evidence.Forms`.
    """

    about: Theta
    steps: tuple[Step, ...]
    prior: Prior
    information: Float64[np.ndarray, "S S"]
    pull: Float64[np.ndarray, " S"]
    pending: Float64[np.ndarray, "S S"]
    """Information that pushes have which were made, or are about to be, and are not screened yet."""
    noise: Covariances
    causes: Mapping[str, tuple[int, ...]]
    """Columns of each cause that is still probable, at the place or in the way that fits best."""
    probabilities: Mapping[str, float]
    nothing: float
    pushes: int
    episodes: int

    @property
    def rivals(self) -> dict[str, tuple[tuple[int, ...], float]]:
        """Hypotheses that are still probable, the null among them: columns and share of the probability."""
        found = {cause: (columns, self.probabilities[cause]) for cause, columns in self.causes.items()}
        total = self.nothing + sum(share for _, share in found.values())
        shared = {cause: (columns, share / total) for cause, (columns, share) in found.items()}
        return {NOTHING: ((), self.nothing / total), **shared}

    @property
    def places(self) -> tuple[tuple[str, Float64[np.ndarray, "2"]], ...]:
        """Estimated places of the rivals that have one [m]."""
        wanted = {cause: columns for cause, (columns, _) in self.rivals.items() if columns}
        placed = {cause: self.steps[columns[0]].given for cause, columns in wanted.items()}
        return tuple((cause, np.array([value for _, value in at])) for cause, at in placed.items() if len(at) == 2)

    def expecting(self, information: Float64[np.ndarray, "S S"]) -> "Belief":
        """The same once a push of this information is about to be made."""
        return replace(self, pending=self.pending + information)


def first_belief(subject: Subject) -> Belief:
    """Belief before any push: all causes that need no place are equally probable."""
    known = subject.catalogue()
    about = known.nominal(subject)
    steps = _one_way(steps_of(known, subject.calibrated, {}))
    prior = prior_of(known, subject.calibrated, about, steps)
    causes = _causes_of(steps, prior)
    count = len(steps)
    return Belief(
        about=about,
        steps=tuple(steps),
        prior=prior,
        information=np.zeros((count, count)),
        pull=np.zeros(count),
        pending=np.zeros((count, count)),
        noise=_unknown_noise(),
        causes=causes,
        probabilities=dict.fromkeys(causes, (1 - _NOTHING_FIRST) / len(causes)),
        nothing=_NOTHING_FIRST,
        pushes=0,
        episodes=0,
    )


@threadpool_limits.wrap(limits=1, user_api="blas")
def belief_of_study(study: Study, subject: Subject) -> Belief:
    """Belief from the pushes of a study, by the refit and the screening of `dipac discover`; takes up to a minute."""
    predictor = Predictor(subject, subject.catalogue())
    trials = prepare(study, subject)
    return belief_of(screen(predictor, trials, refit(predictor, trials)))


def belief_of(screening: Screening) -> Belief:
    """Belief from a screening, with the probabilities that were measured for such screenings."""
    probabilities, nothing = calibration().probabilities(screening)
    suspects = {each.cause: each.columns for each in screening.causes if probabilities[each.cause] > _RIVAL}
    prior, weighing = screening.prior, screening.weighing
    kept = sorted({*prior.nuisance, *(column for columns in suspects.values() for column in columns)})
    at, forms = {column: number for number, column in enumerate(kept)}, weighing.nothing.forms
    return Belief(
        about=screening.about,
        steps=tuple(screening.steps[column] for column in kept),
        prior=Prior(
            mean=prior.mean[kept],
            variance=prior.variance[kept],
            nuisance=tuple(at[column] for column in prior.nuisance),
        ),
        information=forms.A.sum(0)[np.ix_(kept, kept)] / weighing.temperature,
        pull=forms.b.sum(0)[kept] / weighing.temperature,
        pending=np.zeros((len(kept), len(kept))),
        noise=weighing.nothing.covariances,
        causes={cause: tuple(at[column] for column in columns) for cause, columns in suspects.items()},
        probabilities=probabilities,
        nothing=nothing,
        pushes=len(screening.data),
        episodes=len(np.unique(screening.data.episode)),
    )


def gains_of(
    belief: Belief, before: Float64[np.ndarray, "S S"], after: Float64[np.ndarray, "S S"]
) -> Float64[np.ndarray, "C C"]:
    """Information gain [nats] on each rival's size by the information `after` over `before`, both added.

    For each rival (row) if each other (column) may act as well, in the order of `Belief.rivals`; 0 for the null.
    """
    return (_log_volumes(belief, before) - _log_volumes(belief, after)) / 2


def weigh_gains(belief: Belief, gains: Float64[np.ndarray, "C C"]) -> Float64[np.ndarray, "C C"]:
    """Gains by how probable both rivals are."""
    shares = np.array([share for _, share in belief.rivals.values()])
    return gains * np.outer(shares, shares)


def _log_volumes(belief: Belief, added: Float64[np.ndarray, "S S"]) -> Float64[np.ndarray, "C C"]:
    """Logarithms of the determinants of the covariances of rivals' columns, where they and one other may act."""
    prior, rivals = belief.prior, [list(columns) for columns, _ in belief.rivals.values()]
    known = np.linalg.inv(belief.information + added + np.diag(1 / prior.variance))
    # A cause that acts frees its columns: their prior precision falls by so much.
    freed = 1 / (prior.variance + 1.0) - 1 / prior.variance
    found = np.zeros((len(rivals), len(rivals)))
    for (row, own), (column, other) in product(enumerate(rivals), repeat=2):
        if own and row != column:
            both = [*own, *other]
            precision = np.linalg.inv(known[np.ix_(both, both)]) + np.diag(freed[both])
            free = np.linalg.inv(precision)[: len(own), : len(own)]
            found[row, column] = np.linalg.slogdet(free)[1]
    return found


def stop_of(belief: Belief, budget: int) -> Stop | None:
    """Why no further push is made; None where there is a reason for one."""
    if is_named(belief):
        return "named"
    if is_none_left(belief):
        return "none left"
    return "budget" if belief.pushes >= budget else None


def is_named(belief: Belief) -> bool:
    """True if one cause is probable enough to be named, in enough episodes."""
    return belief.episodes >= _EPISODES and max(belief.probabilities.values(), default=0.0) > NAMED


def is_none_left(belief: Belief) -> bool:
    """True if the null hypothesis is probable enough to be accepted, and no cause is worth a refit."""
    return belief.nothing > NAMED and max(belief.probabilities.values(), default=0.0) < _SURVIVOR


def belief_words(belief: Belief) -> str:
    """Text such as `after 16 pushes: table tilt 41 %, draught 22 %, viscous film 9 %, nothing missing 20 %`."""
    ranked = sorted(belief.probabilities.items(), key=lambda pair: -pair[1])[:_LISTED]
    shares = [f"{rival_words(cause)} {words.probability(share)}" for cause, share in ranked]
    nothing = f"{NOTHING} {words.probability(belief.nothing)}"
    pushes = "1 push" if belief.pushes == 1 else f"{belief.pushes} pushes"
    return f"after {pushes}: {', '.join([*shares, nothing])}"


def stop_words(belief: Belief, stop: Stop) -> str:
    """Why no further push is made, in a sentence."""
    match stop:
        case "named":
            best = max(belief.probabilities, key=lambda cause: belief.probabilities[cause])
            return f"Enough: {rival_words(best)} is {words.probability(belief.probabilities[best])} probable."
        case "none left":
            return f"Enough: no cause is left; that nothing is missing is {words.probability(belief.nothing)} probable."
        case "budget":
            return (
                f"The {belief.pushes} pushes that were asked for are made, and no cause stands out enough for a name."
            )


def rival_words(cause: str) -> str:
    """The name of a cause, of nothing or of a force of none of them, in plain words."""
    return "a force of no known cause" if cause == FORMULA else effect_name(cause)


def _one_way(steps: Sequence[Step]) -> list[Step]:
    """Steps of each cause; of one that is asked about in several ways, those of the middle way."""
    ways = dict[str, list[list[int]]]()
    for (cause, _), columns in hypotheses_of(steps, range(len(steps))).items():
        ways.setdefault(cause, []).append(columns)
    kept = sorted(column for found in ways.values() for column in found[len(found) // 2])
    return [steps[column] for column in kept]


def _causes_of(steps: Sequence[Step], prior: Prior) -> dict[str, tuple[int, ...]]:
    free = (column for column in range(len(steps)) if column not in prior.nuisance)
    return {cause: tuple(columns) for (cause, _), columns in hypotheses_of(steps, free).items()}


def _unknown_noise() -> Covariances:
    """Noise of clouds and of direct measurements, before any was learnt."""
    clouds = 4 * MODES
    direct = [np.eye(rows.stop - rows.start) * (least or _UNKNOWN_M) ** 2 for rows, least, _ in direct_blocks(clouds)]
    return (np.eye(clouds) * _UNKNOWN_M**2, *direct)
