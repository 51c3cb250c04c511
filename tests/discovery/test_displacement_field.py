"""The displacement between two clouds without names: found again, whatever the order and number of their points."""

import numpy as np
import pytest

from app.discovery.residuals.displacement_field import MODES, REVERSED, Basis, register
from app.perception.body.resample import resample

N = 300


def rope(points: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A bent rope filled evenly along and at random across, and the place of each point along it."""
    rng = np.random.default_rng(seed)
    place = -1 + 2 * (np.arange(points) + rng.uniform(size=points)) / points
    middle = np.column_stack([0.5 + 0.2 * place, 0.05 * np.cos(2 * place), np.full(points, 0.008)])
    disc = 0.007 * np.sqrt(rng.uniform(size=points))
    angle = rng.uniform(0, 2 * np.pi, points)
    normal = np.column_stack([0.1 * np.sin(2 * place), np.full(points, 0.2), np.zeros(points)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cloud = middle + (disc * np.cos(angle))[:, None] * normal + np.outer(disc * np.sin(angle), [0, 0, 1])
    return cloud.astype(np.float32), place.astype(np.float32)


def displaced(cloud: np.ndarray, place: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    moved = cloud.copy()
    moved[:, :2] += Basis.along(cloud, place).field(amplitudes)
    return moved


@pytest.mark.parametrize("size_m", [0.001, 0.004, 0.02])
@pytest.mark.parametrize("seed", range(3))
def test_a_smooth_displacement_is_found_between_clouds_of_other_points(size_m: float, seed: int) -> None:
    true = np.zeros(2 * MODES)
    true[: MODES // 2] = size_m * np.random.default_rng(seed).normal(size=MODES // 2) / (1 + np.arange(MODES // 2))
    body, place = rope(3000, 10 + seed)
    observed = resample(displaced(body, place, true), N, seed=seed)
    predicted = resample(rope(3000, 20 + seed)[0], N, seed=seed)
    basis = Basis.along(predicted, ((predicted[:, 0] - 0.5) / 0.2).astype(np.float32))
    found = register(predicted, observed, basis)
    across, along = np.split(found - true, 2)
    assert np.linalg.norm(across) < 0.0006 + 0.1 * size_m
    assert np.linalg.norm(along) < 0.004 + 0.1 * size_m  # Only ends and density tell of it.


def test_a_displacement_of_the_same_points_is_projected_exactly() -> None:
    cloud, place = rope(N, 0)
    basis, true = Basis.along(cloud, place), 0.003 * np.random.default_rng(1).normal(size=2 * MODES)
    np.testing.assert_allclose(basis.project(basis.field(true)), true, atol=1e-12)
    both = basis.project(np.stack([basis.field(true), 2 * basis.field(true)]))
    np.testing.assert_allclose(both, np.stack([true, 2 * true]), atol=1e-12)


def test_modes_are_a_metre_in_the_mean_and_at_right_angles() -> None:
    cloud, _ = rope(4000, 2)
    place = np.linspace(-1, 1, 4000, dtype=np.float32)
    vectors = Basis.along(cloud[np.argsort(cloud[:, 0])], place).vectors
    products = np.einsum("nqd,npd->qp", vectors, vectors) / 4000
    np.testing.assert_allclose(products, np.eye(2 * MODES), atol=0.02)


def test_amplitudes_along_an_object_that_is_called_the_other_way_round_differ_in_their_signs_alone() -> None:
    predicted, place = rope(N, 3)
    observed = displaced(*rope(N, 4), 0.003 * np.random.default_rng(5).normal(size=2 * MODES))
    straight, reversed_ = (register(predicted, observed, Basis.along(predicted, way * place)) for way in (1, -1))
    assert np.abs(straight[: MODES // 2]).min() > 1e-5  # Else any sign would do.
    np.testing.assert_allclose(reversed_, REVERSED[: 2 * MODES] * straight, atol=1e-7)
