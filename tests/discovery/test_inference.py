"""Evidence on made-up residuals whose truth is known: sizes, false alarms, outliers, episodes that hang together."""

from dataclasses import replace

import numpy as np
import pytest

from app.discovery.inference import mixed_effects
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.weighing import CALIBRATED, ModelComparison, Prior, dispersion, weigh
from app.discovery.residuals.rows import Block, Residuals

K, R, P = 60, 16, 12
HABIT = 0.08
VARIANCE = np.array([CALIBRATED**2] * 2 + [HABIT**2] * (P - 2))
PRIOR = Prior(mean=np.zeros(P), variance=VARIANCE, nuisance=(0, 1))
BLOCKS = (Block(slice(0, R)),)


def made(seed: int, theta: np.ndarray, *, outliers: float = 0.0, common: float = 0.0, spread: float = 0.0) -> Residuals:
    """Residuals of a linear world [m]: noise of 1 mm that neighbouring modes share, in episodes of six pushes."""
    rng = np.random.default_rng(seed)
    J = 2e-3 * rng.normal(size=(K, R, P))
    root = np.linalg.cholesky(1e-6 * np.exp(-np.abs(np.subtract.outer(np.arange(R), np.arange(R))) / 2))
    noise = rng.normal(size=(K, R)) @ root.T
    episode = np.arange(K) // 6
    noise += common * 1e-3 * (J @ rng.normal(size=(P, K // 6)))[np.arange(K), :, episode] / 2e-3
    wild = rng.uniform(size=K) < outliers
    noise[wild] *= 20
    return Residuals(
        r=J @ theta + noise,
        J=J,
        spread=spread * 1e-3 * rng.normal(size=(K, R, 4)),
        known=np.ones((K, R), bool),
        episode=episode,
        blocks=BLOCKS,
    )


def weighed(data: Residuals) -> ModelComparison:
    return weigh(data, [[column] for column in range(2, P)], PRIOR)


def log_bayes(data: Residuals) -> np.ndarray:
    return np.array([finding.log_bayes for finding in weighed(data).findings])


@pytest.mark.parametrize("seed", range(5))
def test_a_missing_effect_is_first_and_its_size_within_its_interval(seed: int) -> None:
    theta = np.zeros(P)
    theta[0], theta[1], theta[5] = 0.8, -1.2, 0.9
    data = made(seed, theta, outliers=0.1)
    assert np.argmax(log_bayes(data)) == 5 - 2
    found = weighed(data).findings[5 - 2]
    assert found.mean[0] == pytest.approx(0.9, abs=4 * np.sqrt(found.covariance[0, 0]) + 0.02)
    assert np.sqrt(found.covariance[0, 0]) < 0.2


def test_where_nothing_is_missing_evidence_is_against_everything() -> None:
    calibrated = np.zeros(P)
    calibrated[:2] = 1.5, -0.5
    most = [log_bayes(made(seed, calibrated, outliers=0.1)).max() for seed in range(10)]
    assert max(most) < 1.0


def test_pushes_that_nothing_predicts_change_little() -> None:
    theta = np.zeros(P)
    theta[5] = 1.0
    clean, wild = (fit_mixed_effects(made(3, theta, outliers=share), VARIANCE).theta for share in (0.0, 0.2))
    np.testing.assert_allclose(wild, clean, atol=0.05)


@pytest.mark.parametrize("spread", [0.0, 2.0])
def test_a_fit_begun_where_another_ended_stays_there(spread: float) -> None:
    data = made(4, np.full(P, 0.3), outliers=0.1, spread=spread)
    fit = fit_mixed_effects(data, VARIANCE)
    again = fit_mixed_effects(data, VARIANCE, starts=(fit.covariances,))
    assert again.log_likelihood == pytest.approx(fit.log_likelihood, abs=0.05)
    np.testing.assert_allclose(again.theta, fit.theta, atol=1e-3)
    np.testing.assert_allclose(np.diag(again.covariances[0]), np.diag(fit.covariances[0]), rtol=5e-3)


class Astray:
    """Extrapolations that lead elsewhere."""

    def __init__(self, ahead: float) -> None:
        self._ahead = ahead

    def after(self, _begun: np.ndarray, reached: np.ndarray) -> np.ndarray:
        return reached + self._ahead


@pytest.mark.parametrize("ahead", [0.0, 0.9, np.nan])
def test_extrapolated_rounds_end_no_worse_than_others(monkeypatch: pytest.MonkeyPatch, ahead: float) -> None:
    data = made(5, np.full(P, 0.3), outliers=0.3, spread=2.0)
    fit = fit_mixed_effects(data, VARIANCE)
    monkeypatch.setattr(mixed_effects, "AndersonExtrapolation", lambda: Astray(ahead))
    other = fit_mixed_effects(data, VARIANCE)
    assert -0.05 < fit.log_likelihood - other.log_likelihood < 0.5
    np.testing.assert_allclose(fit.theta, other.theta, atol=2e-3)


def test_episodes_that_hang_together_temper_the_evidence() -> None:
    alone = dispersion(fit_mixed_effects(made(1, np.zeros(P)), VARIANCE), [0, 1])
    together = dispersion(fit_mixed_effects(made(1, np.zeros(P), common=1.0), VARIANCE), [0, 1])
    assert alone < 2.0
    assert together > 3 * alone


def test_a_push_whose_end_depends_on_its_start_counts_less() -> None:
    data = made(2, np.zeros(P), spread=0.0)
    spread = np.zeros((K, R, R))
    spread[:6] = 0.02 * np.eye(R)
    chaotic = replace(data, spread=spread)
    share = [fit_mixed_effects(each, VARIANCE).forms.A[0].trace() for each in (data, chaotic)]
    assert share[1] < 0.1 * share[0]


def test_a_push_counts_less_only_where_its_end_depends_on_its_start() -> None:
    data = made(2, np.zeros(P), spread=0.0)
    J = data.J.copy()
    J[:, : R // 2] = 0.0
    spread = np.zeros((K, R, R // 2))
    spread[:, : R // 2] = 0.02 * np.eye(R // 2)
    blind = replace(data, J=J, known=np.arange(R) >= np.full((K, 1), R // 2))
    share = [
        fit_mixed_effects(each, VARIANCE).forms.A.sum(0).trace() for each in (blind, replace(data, J=J, spread=spread))
    ]
    assert share[1] == pytest.approx(share[0], rel=0.15)


def test_where_each_push_errs_by_itself_estimates_scatter_as_much_as_they_say() -> None:
    erring, wrong = 0.3, list[np.ndarray]()
    for seed in range(30):
        data = made(seed, np.zeros(P))
        # A few pushes that nearly anything would move, in all ways.
        J = data.J * np.where(np.arange(K) % 6 == 0, 10.0, 1.0)[:, None, None]
        slopes = erring * np.random.default_rng(1000 + seed).normal(size=(K, P))
        data = replace(data, r=data.r + (J @ slopes[:, :, None])[:, :, 0], J=J)
        each = [replace(data, spread=erring * J), replace(data, spread=np.zeros((K, R, 1)))]
        fits = [fit_mixed_effects(of, np.full(P, CALIBRATED**2)) for of in each]
        wrong.append(np.array([fit.theta / np.sqrt(np.diag(np.linalg.inv(fit.forms.A.sum(0)))) for fit in fits]))
    told, untold = np.sqrt((np.array(wrong) ** 2).mean((0, 2)))
    assert told == pytest.approx(1.0, abs=0.25)
    assert untold > 1.5 * told


@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_an_effect_in_rows_measured_directly_is_not_taken_for_their_noise(size: float) -> None:
    theta = np.zeros(P)
    theta[5] = size
    quiet = made(7, theta)
    exact = replace(quiet, r=quiet.J @ theta, blocks=(Block(slice(0, R), 1e-4),))
    assert fit_mixed_effects(exact, VARIANCE + np.eye(P)[5]).theta[5] == pytest.approx(size, rel=0.02)
    assert np.argmax(log_bayes(exact)) == 5 - 2


def test_what_was_not_seen_counts_for_nothing() -> None:
    theta = np.zeros(P)
    theta[5] = 1.0
    data = made(4, theta)
    known = data.known.copy()
    known[::2, : R // 2] = False
    hidden = replace(data, r=np.where(known, data.r, 1e3), known=known)
    np.testing.assert_allclose(fit_mixed_effects(hidden, VARIANCE).theta[5], 1.0, atol=0.1)
