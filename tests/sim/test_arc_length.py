"""Unordered particles of a rope to labels along it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.config import Workspace
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights
from app.tasks.elements.curves import fill_tube, random_curve


def rope(seed: int, count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """A random rope's noisy particles, shuffled, and where along its centreline each of them truly lies, in 0..1."""
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, length_m=0.4, height_m=0.008, workspace=Workspace())
    x = fill_tube(curve, 0.008, count)[rng.permutation(count)]
    x = (x + 0.0015 * rng.standard_normal(x.shape)).astype(np.float32)
    nearest = np.linalg.norm(x[:, None, :2] - curve[None, :, :2], axis=-1).argmin(1)
    return x, nearest / (len(curve) - 1)


def error(labels: np.ndarray, truth: np.ndarray) -> float:
    """The largest error of any label, in whichever direction fits better."""
    return min(np.abs(labels - truth).max(), np.abs(1 - labels - truth).max())


@settings(max_examples=25)
@given(st.integers(0, 2**31 - 1))
def test_labels_follow_the_rope_whatever_its_shape(seed: int) -> None:
    x, truth = rope(seed)
    assert error(arclength_labels(x), truth) < 0.08


def test_labels_do_not_depend_on_the_order_of_the_particles() -> None:
    x, _ = rope(1)
    shuffle = np.random.default_rng(0).permutation(len(x))
    labels, shuffled = arclength_labels(x), arclength_labels(x[shuffle])
    np.testing.assert_allclose(np.sort(labels), np.sort(shuffled))
    assert error(shuffled, labels[shuffle]) < 0.05


def test_a_rope_seen_in_two_pieces_is_labelled_across_the_gap() -> None:
    x, truth = rope(2)
    seen = np.abs(truth - 0.5) > 0.1
    labels = arclength_labels(x[seen])
    assert np.corrcoef(labels, truth[seen])[0, 1] ** 2 > 0.97


@pytest.mark.parametrize("nodes", [8, 24])
def test_nodes_are_averages_of_particles_in_order_along_the_rope(nodes: int) -> None:
    x, _ = rope(3)
    weights = centreline_weights(arclength_labels(x), nodes)
    np.testing.assert_allclose(weights.sum(1), 1.0, rtol=1e-5)
    line = weights @ x
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    assert steps.max() < 2.5 * 0.4 / nodes
    assert steps.sum() == pytest.approx(0.4 * (1 - 1 / nodes), rel=0.1)
