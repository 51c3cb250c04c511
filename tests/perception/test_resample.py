"""Particles share a body evenly: the exact count, the same for the same seed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from app.perception.body.resample import resample


def block(side: int = 18) -> np.ndarray:
    """A lattice in a 0.2 x 0.1 x 0.1 m block."""
    axes = np.linspace(0, 0.2, 2 * side), np.linspace(0, 0.1, side), np.linspace(0, 0.1, side)
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


def shares(particles: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Number of points of the body that are nearest to each particle."""
    return np.bincount(KDTree(particles).query(body)[1], minlength=len(particles))


@settings(max_examples=30)
@given(count=st.integers(1, 500), size=st.integers(0, 1500), seed=st.integers(0, 2**32 - 1))
def test_there_are_exactly_as_many_as_asked_for(count, size, seed):
    body = np.random.default_rng(seed).normal(size=(count + size, 3)).astype(np.float32)
    particles = resample(body, count, seed=seed)
    assert particles.shape == (count, 3)
    assert particles.dtype == np.float32
    assert (particles >= body.min(axis=0) - 1e-6).all()
    assert (particles <= body.max(axis=0) + 1e-6).all()


def test_the_seed_decides():
    np.testing.assert_array_equal(resample(block(), 200, seed=3), resample(block(), 200, seed=3))
    assert not np.array_equal(resample(block(), 200, seed=3), resample(block(), 200, seed=4))


@pytest.mark.parametrize("seed", range(4))
def test_each_particle_has_about_the_same_share(seed):
    body = block()
    share = shares(resample(body, 300, seed=seed), body)
    assert share.min() > 0.4 * share.mean()
    assert share.std() < 0.25 * share.mean()


@pytest.mark.parametrize("count", [100, 300])
def test_no_point_is_much_farther_than_in_the_densest_covering(count):
    body = block()
    distance = KDTree(resample(body, count, seed=0)).query(body)[0].mean()
    # A ball of a particle's volume has the least mean distance to its centre of all shapes: 3/4 of its radius.
    ball_m = (3 * 0.2 * 0.1 * 0.1 / (4 * np.pi * count)) ** (1 / 3)
    assert distance < 1.12 * 0.75 * ball_m


def test_neighbours_in_order_are_neighbours_in_space():
    particles = resample(block(), 400, seed=0)
    step = np.linalg.norm(np.diff(particles, axis=0), axis=1)
    rng = np.random.default_rng(0)
    shuffled = np.linalg.norm(np.diff(rng.permutation(particles), axis=0), axis=1)
    assert step.mean() < 0.35 * shuffled.mean()


def test_a_flat_body_stays_flat():
    body = block()
    body[:, 2] = 0.01
    assert resample(body, 100, seed=0)[:, 2] == pytest.approx(0.01)


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="7 points cannot be shared by 8 particles"):
        resample(block()[:7], 8, seed=0)
