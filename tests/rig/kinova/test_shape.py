"""Shape of a Gen3: its capsules move as its kinematics do, and its published surface lies inside of them."""

import itertools

import numpy as np
import pytest
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.arm_geometry import ArmShape, JointState
from app.core.geometry.camera import CameraModel
from app.core.geometry.shapes.tools import Tool
from app.core.types import Points
from app.perception.cloud.robot_mask import MARGIN_M, pieces, shadow
from app.rig.kinova import gen3
from app.rig.kinova.shape import known_gen3, tip_m
from app.rig.simulated.cameras.cameras import table_cameras
from app.tasks.bean_sweep import PADDLE
from app.tasks.cloth_hang import GRIPPER
from app.tasks.pour_water import HELD
from app.tasks.rope_push import FINGER

# The farthest points [mm] in eighteen directions of the published surface of each link, in its own frame, base first:
# kortex_description/arms/gen3/7dof/meshes of Kinovarobotics/ros_kortex, with the vision module.
SURFACE = (
    "24,-31,0 46,0,0 4,-46,0 4,46,0 -46,28,0 -45,31,0 -45,-31,0 46,-1,20 34,31,140 0,46,140 0,-46,142 0,46,170 "
    "34,-31,170 0,-46,170 44,-2,171 45,5,171 -45,5,171",
    "33,33,-28 0,46,-28 44,-36,-116 0,-13,-174 0,-42,-169 0,-49,-136 46,-20,-50 -33,33,-28 -44,-36,-116 -46,-20,-50 "
    "42,-14,-2 44,-5,-2 -2,44,-2 -44,0,-2 -2,-44,-2 -34,19,-160 0,19,-174 34,19,-160",
    "0,-194,40 33,-194,26 -32,-194,26 -46,0,-19 -40,-9,-43 -33,33,-19 0,46,-19 33,33,-19 40,-9,-43 0,43,-46 46,0,-19 "
    "0,3,-55 -2,44,-2 11,-225,38 4,-225,39 -45,-225,-6 -4,-225,-52 45,-225,-6",
    "46,-13,-210 -46,-13,-210 0,46,-16 -40,-37,-201 -33,-13,-243 0,-40,-253 0,-49,-213 0,-13,-256 33,-13,-243 "
    "40,-37,-201 -43,11,-2 -44,0,-2 -5,-44,-2 44,0,-2 5,44,-2 0,20,-256 45,21,-216 -45,21,-205",
    "33,33,-19 0,46,-19 25,-194,18 0,-185,29 -25,-194,19 -46,0,-19 -33,33,-19 0,41,-48 -38,-5,-47 0,-6,-56 46,0,-19 "
    "38,-5,-47 -2,44,-2 34,-221,-6 3,-221,28 -3,-221,-41 -35,-220,-6 35,-220,-6",
    "-25,24,-14 0,35,-14 25,24,-14 -35,-14,-106 35,-14,-106 -30,-42,-98 -25,-22,-131 0,-26,-141 0,-44,-135 -3,-53,-112 "
    "30,-42,-98 25,-22,-131 0,12,-141 -7,-32,-2 0,-33,-2 33,0,-2 0,33,-2 -33,0,-2",
    "0,-91,35 35,0,-14 -25,-85,25 -25,25,-22 -30,-8,-43 0,35,-26 0,29,-45 0,6,-53 25,25,-22 25,-85,25 30,-8,-43 "
    "-4,33,-2 34,-118,-8 0,-118,-35 -34,-118,0 -35,-118,0 0,-118,34 34,-118,0",
    "-45,-62,-62 -43,-70,-48 4,-75,-54 43,-70,-48 45,-62,-62 0,-75,-62 -13,-35,-64 -27,26,-41 0,38,-64 27,26,-41 "
    "33,0,-3 3,33,-3 -33,0,-3 -3,-33,-3 -30,5,-2",
)
# The same of grippers/robotiq_2f_85 in the flange's frame, open, half closed and closed; what is nearer to the tip
# than 50 mm is the tool's own.
GRIPPER_SURFACE = (
    "0,-35,0 0,-38,3 31,2,-3 -35,1,0 0,35,0 0,38,3 32,0,-3 74,12,98 74,-12,98 73,-12,102 50,-12,111 43,11,112 "
    "-74,-12,98 -74,12,98 -73,12,102 -50,12,111 67,12,64 67,-12,64 53,-12,113 48,-14,112 26,-8,113 -67,-12,64 "
    "-67,12,64 -53,12,113 -48,14,112 61,-12,75 61,12,75 24,-14,113 32,-7,113 -61,12,75 -61,-12,75 -24,14,113 -32,7,113"
)
FITTED_M = 0.0058
"""Largest distance [m] of a point of the surface outside of all capsules."""
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
RNG = np.random.default_rng(5)


def points_m(said: str) -> Points:
    return np.array([[float(each) for each in point.split(",")] for point in said.split()]) / 1e3


def anywhere() -> gen3.Joints:
    return RNG.uniform(-0.95, 0.95, 7) * np.where(np.isfinite(gen3.RANGE), gen3.RANGE, np.pi)


def tool_pose(joints: gen3.Joints) -> Float64[np.ndarray, "8"]:
    tool = gen3.tool(joints)
    turn = Rotation.from_matrix(tool[:3, :3]).as_quat(scalar_first=True)
    return np.array([*tool[:3, 3], *turn, 0.04])


def surface(joints: gen3.Joints) -> Points:
    """Points [m] on the surface of the whole arm, gripper included, at these joints."""
    links = np.concatenate([np.eye(4)[None], gen3.frames(joints)])
    parts = [points_m(said) @ link[:3, :3].T + link[:3, 3] for said, link in zip(SURFACE, links[:8], strict=True)]
    flange = links[8] @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -gen3.GRIPPER_M], [0, 0, 0, 1]])
    return np.concatenate([*parts, points_m(GRIPPER_SURFACE) @ flange[:3, :3].T + flange[:3, 3]])


def outside_m(shape: ArmShape, joints: gen3.Joints, points: Points) -> Float64[np.ndarray, " N"]:
    """Distance [m] of each point to the nearest capsule; below zero inside."""
    links, nearest = shape.links(joints), np.full(len(points), np.inf)
    for limb in shape.limbs:
        frame = links[limb.link]
        begin, end = (frame[:3, :3] @ np.asarray(each) + frame[:3, 3] for each in (limb.begin, limb.end))
        along = np.clip((points - begin) @ (end - begin) / ((end - begin) @ (end - begin)), 0.0, 1.0)
        away = np.linalg.norm(points - begin - along[:, None] * (end - begin), axis=1)
        nearest = np.minimum(nearest, away - limb.radius_m)
    return nearest


def test_the_links_of_the_shape_are_where_the_kinematics_have_them() -> None:
    shape = known_gen3(FINGER, 0.25)
    for _ in range(20):
        joints = anywhere()
        assert shape.links(joints)[1:] == pytest.approx(gen3.frames(joints)[:7], abs=1e-9)


def test_the_capsules_end_at_the_tip_that_forward_kinematics_say() -> None:
    tip_m = 0.30
    for _ in range(20):
        joints = anywhere()
        shape, tool = known_gen3(FINGER, tip_m), gen3.tool(joints)
        last = shape.limbs[-1]
        frame = shape.links(joints)[last.link]
        end = frame[:3, :3] @ np.asarray(last.end) + frame[:3, 3]
        # The tip of this tool lies on the axis of the tool's frame, and its own 9 cm follow on the last capsule.
        tip = tool[:3, 3] + (tip_m - gen3.GRIPPER_M) * tool[:3, 2]
        assert end == pytest.approx(tip - 0.09 * tool[:3, 2], abs=1e-9)


def test_every_link_is_joined_to_the_one_before_in_every_posture() -> None:
    shape = known_gen3(FINGER, 0.25)
    limbs = [tuple(each for each in shape.limbs if each.link == link) for link in range(8)]
    for _ in range(20):
        joints = anywhere()
        for link, place in enumerate(shape.links(joints)[1:, :3, 3], start=1):
            # Where a joint is, capsules of the link before it and of its own end in each other.
            for side in (link - 1, link):
                one = ArmShape(joints=shape.joints, limbs=limbs[side], tool=shape.tool)
                assert outside_m(one, joints, place[None]).max() < 0.0


def test_the_published_surface_of_arm_and_gripper_is_inside_of_the_capsules() -> None:
    for tool in (FINGER, GRIPPER):
        shape = known_gen3(tool, 0.25)
        for _ in range(10):
            joints = anywhere()
            assert outside_m(shape, joints, surface(joints)).max() < FITTED_M < MARGIN_M


def seen(camera: CameraModel, points: Points) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the points that lie within the image."""
    rotation, eye = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
    pixels = (points - eye) @ rotation @ camera.K.T
    pixels = pixels[pixels[:, 2] > 0.1]
    columns, rows = np.rint(pixels[:, :2] / pixels[:, 2:]).astype(int).T
    within = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    return rows[within], columns[within]


def test_the_mask_covers_the_arm_in_every_image_and_not_much_else() -> None:
    blind, looked = np.zeros((480, 640), np.uint16), 0
    for x, y, camera in itertools.product((0.35, 0.5, 0.6), (-0.2, 0.1), table_cameras()):
        target = DOWN.copy()
        target[:3, 3] = x, y, 0.15
        joints = gen3.solve_joints(target, gen3.HOME)
        assert joints is not None
        shape = known_gen3(FINGER, gen3.GRIPPER_M)
        dark = np.isfinite(shadow(camera, blind, pieces(shape, JointState(joints=joints, tool=tool_pose(joints)))))
        rows, columns = seen(camera, surface(joints))
        assert dark[rows, columns].all()
        assert dark.mean() < 0.35
        looked += len(rows)
    assert looked > 200


@pytest.mark.parametrize("tool", [FINGER, PADDLE, GRIPPER, HELD], ids=["finger", "paddle", "gripper", "bowl"])
def test_near_the_tip_there_is_the_tool_itself_and_no_capsule(tool: Tool) -> None:
    shape, joints = known_gen3(tool, 0.25), anywhere()
    frame = gen3.tool(joints)
    tip = frame[:3, 3] + (0.25 - gen3.GRIPPER_M) * frame[:3, 2]
    assert outside_m(shape, joints, tip[None]).min() > 0.05


@pytest.mark.parametrize("held_m", [gen3.GRIPPER_M, 0.25])
def test_how_far_the_tip_is_from_the_flange_is_told_by_where_both_are(held_m: float) -> None:
    for _ in range(20):
        joints = anywhere()
        tool = gen3.tool(joints)
        tip = tool[:3, 3] + (held_m - gen3.GRIPPER_M) * tool[:3, 2]
        assert tip_m(joints, tip) == pytest.approx(held_m)
