"""The Chamfer distance: what it vanishes on, what it does not depend on, and that it can be descended."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.geometry.chamfer import chamfer_m2


@pytest.fixture
def clouds():
    rng = np.random.default_rng(0)
    return rng.normal(size=(40, 3)), rng.normal(size=(25, 3))


def test_it_vanishes_on_equal_sets_alone(clouds):
    x, _ = clouds
    assert chamfer_m2(x, x) == 0.0
    for index in range(len(x)):
        moved = x.copy()
        moved[index, 2] += 1e-3
        assert chamfer_m2(x, moved) > 0.0


def test_it_is_symmetric(clouds):
    x, y = clouds
    assert chamfer_m2(x, y) == pytest.approx(chamfer_m2(y, x), rel=1e-14)


def test_order_does_not_matter(clouds):
    x, y = clouds
    rng = np.random.default_rng(1)
    assert chamfer_m2(rng.permutation(x), rng.permutation(y)) == pytest.approx(chamfer_m2(x, y), rel=1e-12)


def test_a_rigid_motion_of_both_does_not_matter(clouds):
    x, y = clouds
    rotation = Rotation.from_euler("xyz", [0.3, -1.2, 2.0])
    shift = np.array([4.0, -2.0, 1.0])
    assert chamfer_m2(rotation.apply(x) + shift, rotation.apply(y) + shift) == pytest.approx(chamfer_m2(x, y), rel=1e-9)


def test_the_tree_of_two_numpy_clouds_agrees_with_all_pairs(clouds):
    x, y = clouds
    squared = ((x[:, None] - y[None]) ** 2).sum(-1)
    assert chamfer_m2(x, y) == pytest.approx(squared.min(1).mean() + squared.min(0).mean(), rel=1e-12)


def test_a_number_that_is_not_finite_makes_it_nan(clouds):
    x, y = clouds
    spoiled = x.copy()
    spoiled[3, 1] = np.nan
    for array in (np.asarray, jnp.asarray):
        assert np.isnan(chamfer_m2(array(spoiled), array(y)))
        assert np.isnan(chamfer_m2(array(y), array(spoiled)))


def test_a_shift_that_keeps_neighbours_costs_twice_its_square():
    x = np.stack([np.arange(10.0), np.zeros(10), np.zeros(10)], axis=-1)
    assert chamfer_m2(x, x + np.array([0.0, 0.01, 0.0])) == pytest.approx(2 * 0.01**2, rel=1e-12)


def test_jax_and_numpy_agree(clouds):
    x, y = (cloud.astype(np.float32) for cloud in clouds)
    assert float(chamfer_m2(jnp.asarray(x), jnp.asarray(y))) == pytest.approx(float(chamfer_m2(x, y)), rel=1e-6)


def test_leading_axes_are_candidates(clouds):
    x, y = clouds
    batch = np.stack([x, x + 0.1, x * 2])
    one_by_one = [chamfer_m2(cloud, y) for cloud in batch]
    assert chamfer_m2(batch, y) == pytest.approx(one_by_one, rel=1e-12)


def test_its_gradient_is_finite_where_points_coincide(clouds):
    x = jnp.asarray(clouds[0])
    gradient = jax.grad(lambda moved: chamfer_m2(moved, x))(x)
    assert np.array_equal(gradient, np.zeros_like(gradient))


def test_its_gradient_is_that_of_finite_differences(clouds):
    x, y = clouds
    with jax.enable_x64(True):
        gradient = np.asarray(jax.grad(chamfer_m2)(jnp.asarray(x), jnp.asarray(y)))
    step = 1e-6
    for point, axis in [(0, 0), (7, 1), (39, 2)]:
        offset = np.zeros_like(x)
        offset[point, axis] = step
        slope = (chamfer_m2(x + offset, y) - chamfer_m2(x - offset, y)) / (2 * step)
        assert gradient[point, axis] == pytest.approx(slope, rel=1e-6, abs=1e-9)


def test_descending_it_brings_a_cloud_to_its_goal(clouds):
    x, goal = (jnp.asarray(cloud) for cloud in clouds)
    start = chamfer_m2(x, goal)
    step = jax.jit(lambda x: x - 5.0 * jax.grad(chamfer_m2)(x, goal))
    for _ in range(50):
        x = step(x)
    assert chamfer_m2(x, goal) < 0.2 * start


def test_its_gradient_is_that_of_all_pairs_for_clouds_that_share_a_goal(clouds):
    x, goal = (jnp.asarray(cloud, jnp.float32) for cloud in clouds)
    batch = jnp.stack([x, x + 0.3, 0.7 * x])

    def of_all_pairs(x, y):
        squared = ((x[..., :, None, :] - y[..., None, :, :]) ** 2).sum(-1)
        return squared.min(-1).mean(-1) + squared.min(-2).mean(-1)

    for argument in (0, 1):
        found, expected = (
            jax.grad(lambda *given, by=by: by(*given).sum(), argument)(batch, goal[None])
            for by in (chamfer_m2, of_all_pairs)
        )
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-7)


def test_its_gradient_has_no_number_where_a_point_has_none(clouds):
    x, y = (jnp.asarray(cloud) for cloud in clouds)
    gradient = jax.grad(chamfer_m2)(x.at[3, 1].set(jnp.nan), y)
    assert not np.isfinite(gradient).all()
