"""Fitting: a hidden truth is recovered from slopes, within ranges, and intervals tell how well it is known."""

from collections.abc import Callable

import numpy as np
import pytest

from app.calibration.fit import Fit, FitSettings, fit
from app.core.errors import SimulationError
from app.sim.parameter import ParameterSpec

STIFFNESS = ParameterSpec(name="a", unit="Pa", nominal=1e4, low=1e3, high=1e5, scale="log", about="-")
OFFSET = ParameterSpec(name="b", unit="m", nominal=0.0, low=-1.0, high=1.0, scale="linear", about="-")
SPECS = (STIFFNESS, OFFSET)
TRUTH = np.array([7e3, 0.3])


def world(noise: float, count: int = 40, seed: int = 0) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Squared distances of a smooth, non-linear model to noisy observations of it, above a floor."""
    rng = np.random.default_rng(seed)
    features, errors = rng.uniform(0.5, 1.5, (count, 2)), noise * rng.standard_normal(count)

    def slopes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        u, v = np.log(values[0] / TRUTH[0]), values[1] - TRUTH[1]
        residual = features[:, 0] * np.tanh(u) + features[:, 1] * v + errors
        jacobian = np.stack([features[:, 0] / np.cosh(u) ** 2 / values[0], features[:, 1]], axis=1)
        return residual**2 + 1e-4, 2 * residual[:, None] * jacobian

    return slopes


def found(noise: float, start: np.ndarray, steps: int = 15, seed: int = 0) -> Fit:
    return fit(world(noise, seed=seed), start, SPECS, FitSettings(steps=steps))


@pytest.mark.parametrize("factor", [1 / 3, 3.0])
def test_a_hidden_truth_is_recovered_from_a_start_wrong_by_a_factor_of_three(factor: float) -> None:
    result = found(0.0, np.array([TRUTH[0] * factor, 0.0]))
    np.testing.assert_allclose(result.values, TRUTH, rtol=0.02)


def test_the_result_is_the_best_of_all_trials() -> None:
    result = found(0.05, np.array([2e4, -0.5]))
    losses = [trial.loss_m2 for trial in result.trials]
    assert result.loss_m2 == np.nanmin(losses)
    assert result.loss_m2 < losses[0]
    assert any(np.array_equal(trial.values, result.values) for trial in result.trials)


def test_the_interval_holds_the_value_and_shrinks_with_less_noise() -> None:
    vague, sharp = found(0.2, TRUTH), found(0.02, TRUTH)
    for result in (vague, sharp):
        assert np.all((result.low < result.values) & (result.values < result.high))
    assert np.all(np.log(sharp.high[0] / sharp.low[0]) < 0.5 * np.log(vague.high[0] / vague.low[0]))


def test_values_and_intervals_stay_in_their_ranges() -> None:
    def downhill(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual = np.full(3, 2.0 + np.log(values[0] / 1e3))
        return residual**2, np.stack([2 * residual / values[0], np.zeros(3)], axis=1)

    result = fit(downhill, np.array([5e4, 0.0]), SPECS, FitSettings(steps=20))
    assert result.values[0] == pytest.approx(STIFFNESS.low)
    assert result.low[0] >= STIFFNESS.low * (1 - 1e-9)


def test_a_few_transitions_that_no_parameters_predict_do_not_decide_the_fit() -> None:
    whole = world(0.02)

    def with_outliers(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        losses, gradients = whole(values)
        roots, slopes = np.sqrt(losses[:4]), gradients[:4] / (2 * np.sqrt(losses[:4]))[:, None]
        losses[:4], gradients[:4] = (roots + 2) ** 2, 2 * (roots + 2)[:, None] * slopes
        return losses, gradients

    result = fit(with_outliers, np.array([2e4, 0.0]), SPECS, FitSettings(steps=25))
    np.testing.assert_allclose(result.values, TRUTH, rtol=0.1)


def test_a_parameter_at_the_end_of_its_range_does_not_hold_up_the_others() -> None:
    low = ParameterSpec(name="a", unit="Pa", nominal=2e3, low=1e3, high=3e3, scale="log", about="-")
    slopes = world(0.0)
    result = fit(slopes, np.array([3e3, -0.5]), (low, OFFSET), FitSettings(steps=25))
    assert result.values[0] == pytest.approx(low.high)
    best_m2 = min(slopes(np.array([low.high, b]))[0].mean() for b in np.linspace(-1, 1, 401))
    assert result.loss_m2 < 1.1 * best_m2


def test_transitions_that_cannot_be_predicted_are_left_out() -> None:
    whole = world(0.0)

    def partly(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        losses, gradients = whole(values)
        losses[0], gradients[1, 0] = np.nan, np.inf
        return losses, gradients

    result = fit(partly, np.array([2e4, 0.0]), SPECS, FitSettings(steps=15))
    np.testing.assert_allclose(result.values, TRUTH, rtol=0.02)


def test_a_model_that_predicts_nothing_is_refused() -> None:
    def nothing(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full(3, np.nan), np.zeros((3, 2))

    with pytest.raises(SimulationError, match="predicts none"):
        fit(nothing, TRUTH, SPECS, FitSettings(steps=3))


def test_one_transition_tells_no_interval() -> None:
    def single(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        losses, gradients = world(0.1)(values)
        return losses[:1], gradients[:1]

    result = fit(single, TRUTH, SPECS, FitSettings(steps=2))
    assert result.low.tolist() == pytest.approx([STIFFNESS.low, OFFSET.low])
    assert result.high.tolist() == pytest.approx([STIFFNESS.high, OFFSET.high])


def test_a_trusted_start_yields_to_many_transitions_and_hardly_to_few() -> None:
    start = np.array([2e4, 0.3])

    def moved(count: int) -> float:
        result = fit(world(0.1, count=count), start, SPECS, FitSettings(steps=15, trust_factor=1.5))
        return float(np.log(start[0] / result.values[0]) / np.log(start[0] / TRUTH[0]))

    assert moved(2) < 0.6 * moved(200)
    assert moved(200) > 0.8
