"""The hull of silhouettes holds the object, little more, and nothing that a silhouette excludes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from app.core.colours import ColourRange, colour_mask
from app.core.errors import PerceptionError
from app.core.geometry.arm_geometry import ArmShape, JointState, LinkCapsule
from app.core.geometry.shapes.tools import HeldBowl
from app.core.messages import Frame
from app.perception.cloud.depth import project
from app.perception.cloud.hull import VOXEL_M
from app.perception.cloud.robot_mask import pieces, shadow
from app.perception.reconstruct import PriorKnowledge, Reconstruction, reconstruct
from app.tasks.pour_water import TASK as POUR_WATER
from tests.perception.scene import ROPE_RGB, camera_at, random_tube, render, views

HOW = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300, depth=False)


@pytest.mark.parametrize("seed", range(3))
def test_two_silhouettes_tell_where_a_tube_on_the_table_is(seed):
    tube = random_tube(seed)
    positions = reconstruct(views(tube, seed), HOW).positions
    assert positions.shape == (300, 3)
    assert tube.outside(positions).mean() < 0.003
    assert KDTree(positions).query(tube.curve)[0].max() < 0.012


def test_the_hull_holds_the_object(tube):
    surface = reconstruct(views(tube), HOW).surface
    plan = KDTree(surface[:, :2])
    assert plan.query(tube.curve[:, :2])[0].max() < 0.010
    assert surface[:, 2].max() < HOW.table_m + 2 * HOW.half_width_m


def test_no_silhouette_excludes_a_voxel(tube):
    frames = views(tube, 3)
    surface = reconstruct(frames, HOW).surface
    for frame in frames:
        column, row, _ = np.rint(project(surface, frame.camera)).astype(int).T
        assert colour_mask(frame.color, HOW.colour)[row, column].all()


def test_more_cameras_carve_more(tube):
    rng = np.random.default_rng(0)
    eyes = {"left": (0.55, 0.5, 0.56), "right": (0.55, -0.5, 0.56), "far": (1.05, 0.0, 0.56), "top": (0.5, 0.05, 0.8)}
    frames = [render(tube, camera_at(eye, name=name), rng) for name, eye in eyes.items()]
    few, many = (tube.outside(reconstruct(some, HOW).positions).mean() for some in (frames[:2], frames))
    assert many <= few
    assert many < VOXEL_M / 2


def test_it_is_used_where_every_image_lacks_depth(tube):
    frames = views(tube)
    blind = [replace(frame, depth=np.zeros_like(frame.depth)) for frame in frames]
    np.testing.assert_array_equal(
        reconstruct(blind, replace(HOW, depth=True)).positions, reconstruct(frames, HOW).positions
    )


def test_what_the_arm_hides_is_kept_from_before_without_depth_too(tube):
    part = tube.curve[2 * len(tube.curve) // 5 : 3 * len(tube.curve) // 5]
    over = [(float(x), float(y), float(z) + 0.08) for x, y, z in part[[0, -1]]]
    limb = LinkCapsule(link=0, begin=over[0], end=over[1], radius_m=0.06)
    arm = ArmShape(joints=(), limbs=(limb,), tool=HeldBowl(radius_m=0.05, thickness_m=0.003))
    here = JointState(joints=np.zeros(0), tool=np.array([0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    frames = [replace(frame, time_s=1.0, color=behind(frame, arm, here)) for frame in views(tube, 1)]
    known = PriorKnowledge(arm=arm, postures=(here, here), memory=reconstruct(views(tube), HOW).memory)
    without, kept = reconstruct(frames, HOW), reconstruct(frames, HOW, known=known)
    assert KDTree(without.positions).query(part)[0].max() > 0.015
    assert KDTree(kept.positions).query(tube.curve)[0].max() < 0.012
    assert kept.predicted.any()


def behind(frame: Frame, arm: ArmShape, at: JointState) -> np.ndarray:
    """The colours, grey where the arm is."""
    dark = np.isfinite(shadow(frame.camera, np.zeros_like(frame.depth), pieces(arm, at, margin_m=0.0)))
    return np.where(dark[..., None], np.uint8(90), frame.color)


def test_a_great_many_particles_share_smaller_voxels(tube):
    assert reconstruct(views(tube), replace(HOW, particle_count=9000)).positions.shape == (9000, 3)


def test_silhouettes_that_do_not_meet_are_said(tube):
    left = views(tube)[0]
    right = views(random_tube(9), 1)[1]
    empty = replace(right, color=np.zeros_like(right.color))
    with pytest.raises(PerceptionError, match=r"No view shows the object"):
        reconstruct([replace(left, color=np.zeros_like(left.color)), empty], HOW)


def test_the_level_of_a_liquid_is_not_told_from_its_outline(tube):
    how = replace(POUR_WATER.perception, depth=False)
    with pytest.raises(PerceptionError, match=r"level of a liquid cannot be told.*--no-depth"):
        reconstruct(views(tube), how)
