"""Predicting real pushes: centrelines of ropes with tassels, weights of models, and that the data are better explained
than by nothing that moves."""

import numpy as np
import pytest

from bench import real_pushes, rope_pushes
from bench.leave_one_out import folds
from bench.real_centrelines import length_m, places_along, principal_curve, rods_along
from bench.real_pushes import AXES, FREE, Rope, mass_shares, posterior

RADIUS_M = 0.006


def arc(count: int, length: float = 0.40, turn_rad: float = 1.2) -> np.ndarray:
    heading = turn_rad * (np.linspace(0, 1, count) - 0.5)
    steps = length / (count - 1) * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps[:-1], axis=0)])


def tasselled(seed: int = 0) -> np.ndarray:
    """Points of a rope along `arc` whose first and last tenth hold three times the points, twice as wide."""
    rng = np.random.default_rng(seed)
    line = arc(401)
    normal = np.stack([-np.gradient(line[:, 1]), np.gradient(line[:, 0])], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    s = np.concatenate([rng.uniform(0, 1, 500), rng.uniform(0, 0.1, 100), rng.uniform(0.9, 1, 100)])
    at = np.round(400 * s).astype(int)
    wide = np.where((s < 0.1) | (s > 0.9), 2 * RADIUS_M, RADIUS_M)
    flat = line[at] + (wide * rng.uniform(-1, 1, len(s)))[:, None] * normal[at]
    return np.column_stack([flat, rng.uniform(0, 2 * RADIUS_M, len(s))]).astype(np.float32)


def test_the_centreline_of_a_rope_with_tassels_is_found_and_is_as_long_as_the_rope() -> None:
    line = principal_curve(tasselled(), 41)
    truth = arc(41)
    apart = min(np.linalg.norm(line - each, axis=1).mean() for each in (truth, truth[::-1]))
    assert apart < RADIUS_M
    assert length_m(line) == pytest.approx(0.40, abs=0.012)


def test_points_that_are_carried_by_a_rod_at_rest_are_where_they_were() -> None:
    cloud = tasselled()
    (rod,) = rods_along([principal_curve(cloud, 41)], [cloud], 0.01)
    np.testing.assert_allclose(np.asarray(rod.x[0]), cloud, atol=1e-5)


def test_places_along_a_straight_line_are_its_coordinates_and_go_on_beyond_its_ends() -> None:
    line = np.stack([np.arange(5.0), np.zeros(5)], axis=1)
    flat = np.array([[1.25, 0.3], [-2.0, 0.1], [9.0, 0.0]])
    np.testing.assert_allclose(places_along(flat, line), [1.25, 0.0, 4.0])
    np.testing.assert_allclose(places_along(flat, line, 10.0), [1.25, -2.0, 9.0])


def test_tassels_make_a_rope_heavier_where_they_are_and_by_nothing_where_they_weigh_nothing() -> None:
    cloud = tasselled()
    line = principal_curve(cloud, 41)
    light, heavy = (mass_shares([cloud], [line], tassels) for tassels in (0.0, 1.0))
    assert light.sum() == heavy.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(light[1:-1], light[1])
    assert heavy[1:4].mean() > 2 * heavy[10:30].mean()
    np.testing.assert_allclose(heavy, heavy[::-1])


def test_the_posterior_of_a_quadratic_is_its_minimum_and_as_wide_as_it_is_flat() -> None:
    pool = np.random.default_rng(0).random((4000, 2))
    truth, steep = np.array([0.4, 0.6]), np.array([40.0, 4.0])
    mm2 = 1.0 + (steep * (pool - truth) ** 2).sum(1)
    every = np.tile(mm2[None, :, None], (3, 1, 8))
    found = posterior(pool, every, folds(8)[-1], FREE[:2])
    value = np.array([AXES[name].value(u) for name, u in zip(FREE[:2], truth, strict=True)])
    assert found.values == pytest.approx(value, rel=0.05)
    low, high = np.log(found.interval)
    spans = [np.log(AXES[name].high / AXES[name].low) for name in FREE[:2]]
    assert 2 < ((high - low) / spans)[1] / ((high - low) / spans)[0] < 4


def test_a_rod_explains_the_real_pushes_far_better_than_that_nothing_moves() -> None:
    if not rope_pushes.FOLDER.is_dir():
        pytest.skip(f"the recorded pushes are not in {rope_pushes.FOLDER}")
    pushes = real_pushes.real_pushes(rope_pushes.recorded_pushes())
    still = real_pushes.compared(list(pushes.before), list(pushes.after))
    values = np.array([[0.1, 0.5, 0.019, 0.016]])
    rope = Rope(pushes, 0.5)
    assert rope.scores(values, FREE).mm2.mean() < 0.1 * still.mm2.mean()
    assert rope.cloud_scores(values[0], FREE).mm.mean() < 0.25 * still.mm.mean()


def test_where_the_pushes_are_absent_the_bench_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    real_pushes.main(folder=rope_pushes.FOLDER / "absent")
    assert "not in" in capsys.readouterr().out
