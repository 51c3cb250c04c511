"""A cloud keeps its shape whatever the number of its points becomes."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from app.core.types import Cloud
from app.perception.body.resample_to_count import FEWEST, resample_bodies, resample_to

COUNT = 300


def cloud(points: int) -> Cloud:
    """Along an arc, 16 mm thick."""
    rng = np.random.default_rng(points)
    angle, radius = rng.uniform(0, np.pi, points), 0.12 + rng.uniform(-0.008, 0.008, points)
    z = rng.uniform(0, 0.016, points)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z]).astype(np.float32)


def test_a_cloud_of_the_right_size_is_left_as_it_is() -> None:
    x = cloud(COUNT)
    assert resample_to(x, COUNT) is x


@pytest.mark.parametrize("points", [FEWEST, 100, 299, 301, 5000])
def test_particles_lie_where_the_cloud_is_and_cover_it(points: int) -> None:
    x = cloud(points)
    particles = resample_to(x, COUNT)
    assert particles.shape == (COUNT, 3)
    gap = np.pi * 0.12 / points  # Along the arc from point to point: a sparse cloud is known no better.
    assert KDTree(x).query(particles)[0].max() < 0.012 + 4 * gap
    assert KDTree(particles).query(x)[0].max() < 0.012 + 4 * gap
    assert np.array_equal(particles, resample_to(x, COUNT))


def test_hardly_any_points_are_refused() -> None:
    with pytest.raises(ValueError, match="too few"):
        resample_to(cloud(FEWEST - 1), COUNT)


def test_bodies_of_a_cloud_stay_one_after_another() -> None:
    def split(total: int) -> tuple[int, ...]:
        return total - total // 5, total // 5

    broth, pieces = cloud(400), cloud(100) + np.array([1.0, 0.0, 0.0], np.float32)
    found = resample_bodies(np.concatenate([broth, pieces]), COUNT, split)
    assert found.shape == (COUNT, 3)
    assert np.array_equal(found[:, 0] > 0.5, np.arange(COUNT) >= split(COUNT)[0])
    assert resample_bodies(found, COUNT, split) is found
    with pytest.raises(ValueError, match="too few"):
        resample_bodies(cloud(FEWEST + 20), COUNT, split)
