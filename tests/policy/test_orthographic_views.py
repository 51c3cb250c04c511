"""Pictures of particles: what is where, nothing from outside, and slopes that are those of small changes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.policy.orthographic_views import OrthographicView
from app.tasks import load, names

TOP = OrthographicView(low=(0.2, -0.3, 0.0), high=(0.8, 0.3, 0.1), pixel_m=0.01)
SIDE = OrthographicView(low=(0.2, -0.3, 0.0), high=(0.8, 0.3, 0.3), pixel_m=0.01, axes=(2, 1, 0))


def middles(view: OrthographicView, pixels: np.ndarray) -> np.ndarray:
    """Points in the middle of pixels, half way up."""
    points = np.empty((len(pixels), 3))
    rows, columns, up = view.axes
    points[:, rows] = view.low[rows] + (pixels[:, 0] + 0.5) * view.pixel_m
    points[:, columns] = view.low[columns] + (pixels[:, 1] + 0.5) * view.pixel_m
    points[:, up] = view.low[up] + 0.5 * view.depth_m
    return points


@pytest.mark.parametrize("view", [TOP, SIDE])
def test_particles_are_in_the_pixels_that_they_are_over(view: OrthographicView) -> None:
    pixels = np.array([[3, 4], [10, 20], [25, 59]])
    picture = np.asarray(view.picture(jnp.asarray(middles(view, pixels))[None]))[0]
    assert picture.shape == (*view.shape, 2)
    assert all(side % 16 == 0 for side in view.shape)
    assert {tuple(each) for each in np.argwhere(picture[..., 0] > 1e-3)} == {tuple(each) for each in pixels}
    assert picture[10, 20, 1] == pytest.approx(0.5, abs=1e-5)


def test_how_many_particles_there_are_makes_no_difference_to_how_dense_they_look() -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform(TOP.low, TOP.high, (4000, 3))
    few, many = (np.asarray(TOP.picture(jnp.asarray(each)[None]))[0, ..., 0].sum() for each in (x[:400], x))
    assert few == pytest.approx(many, rel=0.02)


def test_what_lies_outside_is_not_in_the_picture() -> None:
    x = np.array([[0.1, 0.0, 0.05], [0.5, -0.5, 0.05], [2.0, 2.0, 0.05]])
    assert np.asarray(TOP.picture(jnp.asarray(x)[None])).max() == 0.0


def test_slopes_are_those_of_small_changes() -> None:
    rng = np.random.default_rng(1)
    # Not where a particle passes from one pixel to the next: a height jumps there.
    x = middles(TOP, rng.integers(5, 50, (30, 2))) + rng.uniform(0.001, 0.004, (30, 3))
    weights = rng.standard_normal((1, *TOP.shape, 2))

    def looked(x: jax.Array) -> jax.Array:
        return (weights * TOP.picture(x)).sum()

    here, way, step = jnp.asarray(x)[None], jnp.asarray(rng.standard_normal((1, *x.shape))), 1e-4
    secant = (looked(here + step * way) - looked(here - step * way)) / (2 * step)
    assert float((jax.grad(looked)(here) * way).sum()) == pytest.approx(float(secant), rel=2e-3)


@pytest.mark.parametrize("name", names())
def test_each_task_is_seen_whole_and_from_the_side_where_heights_tell_more(name: str) -> None:
    task = load(name)
    count = task.preset("cpu").particle_count
    assert len(task.views) == (2 if name in ("cloth_hang", "pour_soup", "pour_water") else 1)
    for seed in range(3):
        objects = np.stack([task.particles(task.start(seed), count), task.goal(seed, count)])
        for view in task.views:
            seen = np.asarray(view.pixels(jnp.asarray(objects)))
            inside = ((seen > -0.5) & (seen < np.array(view.shape) - 0.5)).all(-1)
            assert inside.mean() > 0.98
