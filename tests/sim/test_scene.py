"""Scenes: what is off the grid is brought back to where it can be simulated."""

import numpy as np

from app.sim.runtime.checks import inside
from tests.sim.scenes import SCENE


def test_particles_off_the_grid_are_brought_to_where_they_can_be_simulated_and_others_stay() -> None:
    low, high = np.array(SCENE.low, np.float32), np.array(SCENE.high, np.float32)
    middle = (low + high) / 2
    at_faces = np.concatenate([np.where(np.eye(3, dtype=bool), face, middle) for face in (low, high)])
    beyond = middle + 3 * (at_faces - middle)
    x = np.concatenate([at_faces, beyond]).astype(np.float32)
    assert not inside(SCENE, x).any()
    assert inside(SCENE, SCENE.clip_to_grid(x)).all()
    within = np.stack([middle, low + 1.5 * SCENE.cell_m]).astype(np.float32)
    np.testing.assert_array_equal(SCENE.clip_to_grid(within), within)
