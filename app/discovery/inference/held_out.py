"""Leave-one-episode-out: how much likelier a model makes episodes that it was not fitted to."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.stats import t

from app.discovery.inference.mixed_effects import Covariances, fit_mixed_effects, log_likelihood
from app.discovery.inference.refine import RefinedModel
from app.discovery.inference.screen import CandidateCause, Screening
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.rows import Residuals

_ERRORS = 2
"""Standard errors by which episodes that a cause was not fitted to have to be more likely with it."""
_TRIMMED = 0.2
"""Share of episodes, of the best and of the worst, that a mean leaves out: where a rope slips off the tool or not, an
episode gains or loses ten times what the others do."""
_FEWEST = 10
"""Episodes of which a mean is trimmed: of five, the error of a trimmed mean is a fifth too small."""


class HeldOutGain(NamedTuple):
    """Gain in log likelihood of left-out episodes over the null hypothesis: trimmed mean and standard error."""

    gain: float
    error: float


def held_out_gain(simpler: tuple[Residuals, Prior], model: RefinedModel) -> HeldOutGain:
    """Leave-one-episode-out: the trimmed mean over episodes of the gain in log likelihood, and its standard error."""
    return _held_out_gain(simpler, (model.data, model.prior), (None, model.fit.covariances))


def held_out_gain_of_linear(screening: Screening, suspect: CandidateCause, rivals: Sequence[int] = ()) -> HeldOutGain:
    """The same of a cause about the nominal model, by the simulations that all causes were weighed with.

    Simulated anew, chaotic pushes end elsewhere, which costs or gains more than a weak effect does. The nominal model
    has nothing of the cause, and learns nothing of it: what is there by a hundred standard deviations, the null
    hypothesis would find in other episodes, too, however small it takes it to be. Nor has it anything of the `rivals`,
    columns of causes that do nearly the same: a depth bias is a depth scale of a thousandth at one distance.
    """
    data, usual = screening.data, screening.prior.without(sorted({*rivals} - {*suspect.columns}))
    absent, present = usual.without(suspect.columns), usual.wider(suspect.columns)
    return _held_out_gain((data, absent), (data, present), (None, screening.weighing.nothing.covariances))


def _held_out_gain(
    simpler: tuple[Residuals, Prior], extended: tuple[Residuals, Prior], starts: Sequence[Covariances | None]
) -> HeldOutGain:
    episodes = np.unique(extended[0].episode).tolist()
    gains = np.array(
        [_likelihood(*extended, episode, starts) - _likelihood(*simpler, episode, starts) for episode in episodes]
    )
    return trimmed_mean(gains)


def trimmed_mean(gains: Float64[np.ndarray, " E"]) -> HeldOutGain:
    """The trimmed mean of episodes, and its standard error (Tukey and McLaughlin 1963).

    The error is as much larger as makes two of it as rare as two of a plain mean, by Student's distribution of fewer
    degrees of freedom.
    """
    count = len(gains)
    out = int(_TRIMMED * count) if count >= _FEWEST else 0
    if count < 2:
        return HeldOutGain(float(gains.mean()), np.inf)
    ordered, inner = np.sort(gains), count - 2 * out
    winsorized = np.clip(gains, ordered[out], ordered[count - 1 - out])
    error = winsorized.std(ddof=1) * np.sqrt(count) / inner
    rarer = t.ppf(t.cdf(_ERRORS, count - 1), inner - 1) / _ERRORS
    return HeldOutGain(float(ordered[out : count - out].mean()), float(error * rarer))


def is_earned(held: HeldOutGain) -> bool:
    """True if episodes that were left out are more likely by enough standard errors."""
    return held.gain > _ERRORS * held.error


def earned_by_either(refitted: HeldOutGain, linear: HeldOutGain, refit_evidence: float) -> HeldOutGain:
    """The gain by which a single cause is earned: its refit's, or else that of the screening's simulations.

    The latter counts only where the refit does not contradict it: `refit_evidence` is the logarithm of its Bayes factor
    over the nominal model [nats].
    """
    return linear if not is_earned(refitted) and is_earned(linear) and refit_evidence > 0 else refitted


def _likelihood(data: Residuals, prior: Prior, episode: int, starts: Sequence[Covariances | None]) -> float:
    fit = fit_mixed_effects(data.without(episode), prior.variance, prior.mean, starts)
    return log_likelihood(data.of(data.episode == episode), fit.theta, fit.covariances)


def left_out_thetas(model: RefinedModel) -> dict[int, Float64[np.ndarray, " P"]]:
    """All columns' values when an episode is left out, in steps from the model's theta; own ones as far as trusted."""
    found = dict[int, Float64[np.ndarray, " P"]]()
    for episode in np.unique(model.data.episode):
        fit = fit_mixed_effects(
            model.data.without(int(episode)), model.prior.variance, model.prior.mean, (model.fit.covariances,)
        )
        found[int(episode)] = np.concatenate([model.trust * fit.theta[: model.own], fit.theta[model.own :]])
    return found
