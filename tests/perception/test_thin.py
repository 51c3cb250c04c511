"""A cloth as the simulated cameras see it, lying, hanging and held, becomes particles of the cloth that is there."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from app.core.colours import ColourRange
from app.perception.cloud.fuse import Box
from app.perception.reconstruct import Reconstruction, reconstruct
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.worlds.cloth_world import ClothWorld
from tests.rig.cloth_scene import CLOTH, GRIPPER, KNOTS, RACK, STAGE, flat, grasped, hand

HOW = Reconstruction(
    colour=ColourRange.around(CLOTH.colour),
    particle_count=256,
    box=Box(low=(0.20, -0.40, -0.02), high=(0.90, 0.40, 0.47)),
    table_margin_m=-0.02,
    underside="thin",
    voxel_m=0.004,
)
SPACING_M = CLOTH.size_m / 16


def lying() -> ClothWorld:
    world = ClothWorld(CLOTH, GRIPPER, flat(0.55, -0.17, turn_rad=0.4), fixtures=(RACK,))
    world.place(hand(0.30, 0.0, 0.30, 0.0))
    return world


def draped() -> ClothWorld:
    world = ClothWorld(CLOTH, GRIPPER, flat(0.55, RACK.place_m[1], 0.195), fixtures=(RACK,))
    world.place(hand(0.40, -0.20, 0.30, 0.04))
    world.step(world.tool, 1.0)
    return world


def held() -> ClothWorld:
    world = ClothWorld(CLOTH, GRIPPER, flat(0.50, -0.18), fixtures=(RACK,))
    grasped(world, 0.50, -0.067)
    return world


def truth(world: ClothWorld) -> np.ndarray:
    """The middles of all triangles of the mesh, and its knots."""
    knots = world.nodes().reshape(KNOTS, KNOTS, 3)
    a, b, c, d = knots[:-1, :-1], knots[:-1, 1:], knots[1:, :-1], knots[1:, 1:]
    middles = [(a + b + c) / 3, (b + c + d) / 3, (b + c) / 2, (a + b) / 2, (a + c) / 2]
    return np.concatenate([knots.reshape(-1, 3), *(each.reshape(-1, 3) for each in middles)])


# What the fingers hide of a cloth that they hold is half as wide as they are.
@pytest.mark.parametrize(("make", "hidden_m"), [(lying, 0.0), (draped, 0.0), (held, GRIPPER.half_m[0])])
def test_particles_are_on_the_cloth_and_leave_no_part_of_it_out(make, hidden_m):
    world = make()
    frames = SimulatedCameras(STAGE, (), 0).look(world.snapshot(), stamp_s=0.0, number=1)
    seen, cloth = reconstruct(frames, HOW).positions, truth(world)
    assert seen.shape == (256, 3)
    off = KDTree(cloth).query(seen)[0]
    # Between the points that stand for the cloth, 4 mm apart, and with 2 mm of noise of the depth.
    assert np.quantile(off, 0.99) < 0.007
    assert KDTree(seen).query(cloth)[0].max() < SPACING_M + hidden_m
    assert np.linalg.norm(seen.mean(axis=0) - cloth.mean(axis=0)) < SPACING_M / 4 + hidden_m / 2


def test_what_lies_on_the_table_is_not_filled_and_stays_flat():
    frames = SimulatedCameras(STAGE, (), 0).look(lying().snapshot(), stamp_s=0.0, number=1)
    z = reconstruct(frames, HOW).positions[:, 2]
    assert np.abs(z - 0.002).max() < 0.003
