"""The simulated cell's own images, whose flaws and arm perception was not made for, become the rope that is there."""

import numpy as np
import pytest

from app.core.colours import ColourRange
from app.core.geometry.scene_description import Rope, Stage
from app.core.geometry.shapes.tools import Finger
from app.core.messages import Frame, fresh_id
from app.perception.reconstruct import Reconstruction, reconstruct
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.rope_world import RopeWorld
from bench.tube import Tube
from tests.perception.scene import random_tube

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.064, colour=(0.80, 0.24, 0.10))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)
HOW = Reconstruction(colour=ColourRange.around(ROPE.colour), particle_count=300)


def photographed(world: RopeWorld, seed: int) -> list[Frame]:
    snapshot, rng = world.snapshot(), np.random.default_rng(seed)
    frames = []
    for camera in table_cameras():
        color, depth = render(snapshot, camera, rng, stage=Stage(body=ROPE, tool=FINGER))
        frames.append(Frame(id=fresh_id("frame"), time_s=world.time_s, camera=camera, color=color, depth=depth))
    return frames


@pytest.mark.parametrize("seed", range(2))
def test_the_rope_is_recovered_at_rest_and_with_the_finger_beside_it(seed):
    world = RopeWorld(ROPE, FINGER, random_tube(seed).curve)
    world.step(world.tool, 0.3)
    middle = world.nodes()[len(world.nodes()) // 2]
    for tool in (world.tool, np.array([middle[0], middle[1], 0.05])):
        world.step(tool, 0.5)
        rope = Tube(curve=world.nodes(), radius_m=ROPE.radius_m)
        positions = reconstruct(photographed(world, seed), HOW).positions
        truth = rope.samples(3000, np.random.default_rng(0))
        assert rope.outside(positions).mean() < 0.0005
        assert rope.uncovered(truth, positions).mean() < 0.001
        assert positions[:, 2].mean() == pytest.approx(truth[:, 2].mean(), abs=0.0005)
