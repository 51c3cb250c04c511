"""Laws of what predictions need to know of a study."""

import numpy as np

from app.discovery.dataset.labels import label_particles
from app.discovery.dataset.model_under_test import RodModel
from app.sim.rods.scene import RodScene
from app.tasks.elements.curves import fill_tube

ROPE = RodScene(length_m=0.40, radius_m=0.008, mass_kg=0.064, finger_radius_m=0.009)


def hairpin(apart_m: float) -> np.ndarray:
    """Centreline (n, 3) [m] of a rope that lies twice beside itself, its strands so far apart."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 40)
    leg = (ROPE.length_m - np.pi * apart_m / 2) / 2
    there = np.stack([np.linspace(-leg, 0, 80, endpoint=False), np.full(80, -apart_m / 2)], axis=1)
    back = np.stack([np.linspace(0, -leg, 81)[1:], np.full(80, apart_m / 2)], axis=1)
    line = np.concatenate([there, apart_m / 2 * np.stack([np.cos(turn), np.sin(turn)], axis=1), back])
    return np.column_stack([line, np.full(len(line), ROPE.radius_m)])


def test_labels_run_along_a_rope_whose_strands_touch():
    cloud = fill_tube(hairpin(2.1 * ROPE.radius_m), ROPE.radius_m, 300)
    truth = hairpin(2.1 * ROPE.radius_m)
    nearest = np.linalg.norm(cloud[:, None, :2] - truth[None, :, :2], axis=-1).argmin(1)
    steps = np.linalg.norm(np.diff(truth[:, :2], axis=0), axis=1)
    true = 2 * (np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum())[nearest] - 1
    labels = label_particles([cloud], RodModel(scene=ROPE))[0][0, :, 0]
    assert min(np.abs(labels - true).max(), np.abs(labels + true).max()) < 0.08
    without = label_particles([cloud])[0][0, :, 0]
    assert min(np.abs(without - true).max(), np.abs(without + true).max()) > 0.5  # Else this rope would ask nothing.
