"""Quadratics through losses: what they are of is found again, and what losses do not tell is unknown."""

import numpy as np
import pytest

from app.calibration.quadratics import Quadratics, fit_quadratics

K, Q, M = 30, 3, 40


def sampled(noise: float = 0.0) -> tuple[Quadratics, np.ndarray, np.ndarray, np.ndarray]:
    """Random quadratics of a positive curvature, with values and slopes at random points."""
    rng = np.random.default_rng(0)
    roots = rng.standard_normal((K, Q, Q))
    g, H = 0.1 * rng.standard_normal((K, Q)), 1e-2 * roots @ roots.transpose(0, 2, 1)
    z = rng.uniform(-1, 1, (M, Q))
    losses = 1.0 + np.einsum("kq,mq->mk", g, z) + 0.5 * np.einsum("mq,kqr,mr->mk", z, H, z)
    slopes = g + np.einsum("kqr,mr->mkq", H, z)
    return Quadratics(g=g, H=H), z, losses + noise * rng.standard_normal(losses.shape), slopes


def test_a_quadratic_is_found_again() -> None:
    truth, z, losses, slopes = sampled()
    found = fit_quadratics(z, losses, slopes)
    np.testing.assert_allclose(found.g, truth.g, atol=1e-9)
    np.testing.assert_allclose(found.H, truth.H, atol=1e-9)


def test_noise_of_losses_is_averaged_over_points() -> None:
    truth, z, losses, slopes = sampled(0.01)
    assert np.abs(fit_quadratics(z, losses, slopes).g - truth.g).max() < 0.01


def test_the_deviation_is_that_of_minima_of_samples_of_transitions() -> None:
    """Known curvature: the minimum of a mean of K quadratics with slopes of spread s is off by s / sqrt(K) / H."""
    rng = np.random.default_rng(1)
    g = rng.standard_normal((400, 2)) * [1.0, 0.2]
    of = Quadratics(g=g, H=np.tile(np.diag([2.0, 4.0]), (400, 1, 1)))
    expected = np.array([1.0 / 2.0, 0.2 / 4.0]) / 20
    assert of.deviation(np.ones(400)) == pytest.approx(expected, rel=0.1)


def test_what_losses_do_not_depend_on_is_unknown() -> None:
    g = np.random.default_rng(2).standard_normal((10, 2)) * [1.0, 0.0]
    of = Quadratics(g=g, H=np.tile(np.diag([1.0, 0.0]), (10, 1, 1)))
    known, unknown = of.deviation(np.ones(10))
    assert np.isfinite(known)
    assert np.isinf(unknown)
    nothing = Quadratics(g=0 * g, H=np.zeros((10, 2, 2)))
    assert np.isinf(nothing.deviation(np.ones(10))).all()


def test_of_two_coordinates_of_which_only_the_sum_matters_each_is_unknown_and_their_sum_is_known() -> None:
    slopes = 1e-2 * np.random.default_rng(3).standard_normal((20, 1))
    of = Quadratics(g=np.tile(slopes, (1, 2)), H=np.ones((20, 2, 2)))
    assert of.deviation(np.ones(20)).min() > 0.3


def test_a_few_slopes_that_are_a_million_times_too_steep_do_not_decide() -> None:
    truth, z, losses, slopes = sampled()
    slopes = slopes.copy()
    slopes[3] *= 1e6
    slopes[17, ::2] *= -1e5
    found = fit_quadratics(z, losses, slopes)
    np.testing.assert_allclose(found.g, truth.g, atol=0.01)
    np.testing.assert_allclose(found.H, truth.H, atol=0.03)
