"""Laws of a cloth's threads as found from unordered particles."""

import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.materials.threads import cloth_at_rest, threads

SPACING_M = 0.014


def sheet(rng: np.random.Generator, count: int = 20) -> np.ndarray:
    """Particles (N, 2) of a sheet, shaken by a fifth of their spacing, in no order."""
    plan = np.stack(np.meshgrid(*[np.arange(count) * SPACING_M] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    return rng.permutation(plan + rng.uniform(-0.2, 0.2, plan.shape) * SPACING_M)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A random one."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turn * np.sign(np.linalg.det(turn))


def found(x: np.ndarray) -> np.ndarray:
    """The threads (N, 3, 3) of one cloth."""
    return np.asarray(threads(jnp.asarray(x, jnp.float32)[None])[0], np.float64)


@pytest.mark.parametrize("seed", range(5))
def test_threads_of_a_flat_cloth_lie_in_its_plane_however_it_is_turned(seed: int):
    rng = np.random.default_rng(seed)
    plan, turn = sheet(rng), rotation(rng)
    F = found(np.concatenate([plan, np.zeros((len(plan), 1))], axis=1) @ turn.T + rng.normal(size=3))
    assert np.abs(F[..., 2] @ turn[:, 2]) == pytest.approx(np.ones(len(plan)), abs=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_threads_are_a_rotation_wherever_particles_are(seed: int):
    F = found(np.random.default_rng(seed).normal(size=(80, 3)) * 0.1)
    assert F @ np.swapaxes(F, 1, 2) == pytest.approx(np.broadcast_to(np.eye(3), F.shape), abs=1e-5)
    assert np.linalg.det(F) == pytest.approx(np.ones(80), abs=1e-5)


def test_threads_follow_a_cloth_over_a_rod():
    rng, radius = np.random.default_rng(0), 0.05
    plan = sheet(rng)
    angle = (plan[:, 1] - plan[:, 1].mean()) / radius
    x = np.stack([plan[:, 0], radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    normal = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=1)
    inside = np.all((plan > 2 * SPACING_M) & (plan < plan.max() - 2 * SPACING_M), axis=1)
    off = np.abs(np.einsum("ni,ni->n", found(x)[..., 2], normal))[inside]
    assert np.degrees(np.arccos(np.minimum(off, 1.0))).max() < 8.0


def test_particles_that_are_few_or_in_one_place_have_threads_too():
    assert np.isfinite(found(np.zeros((5, 3)))).all()
    assert np.isfinite(found(np.random.default_rng(0).normal(size=(2, 3)))).all()


def test_a_cloth_that_is_seen_is_at_rest():
    state = cloth_at_rest(jnp.asarray(np.random.default_rng(0).normal(size=(2, 30, 3)), jnp.float32))
    assert not state.v.any()
    assert not state.C.any()
    assert np.linalg.norm(np.asarray(state.F), axis=2) == pytest.approx(np.ones((2, 30, 3)), abs=1e-5)
