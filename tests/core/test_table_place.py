"""A table somewhere else: the same things, told in its frame and in that of the arm's base."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.motion import pointing_down
from tests.recording.test_calibration_file import camera

PLACES = st.builds(TablePlace, place_m=st.tuples(*[st.floats(-1, 1)] * 3), turn_deg=st.floats(-180, 180))


@given(PLACES, st.tuples(*[st.floats(-1, 1)] * 3), st.floats(-3, 3))
def test_a_pose_of_the_base_is_the_same_place_and_turn_in_the_table_s_frame(
    table: TablePlace, place: tuple[float, float, float], yaw: float
) -> None:
    pose = pointing_down(np.array(place))
    pose[3:7] = (Rotation.from_euler("z", yaw) * Rotation.from_quat([0, 1, 0, 0], scalar_first=True)).as_quat(
        scalar_first=True
    )
    pose[7] = 0.03
    moved = table.poses_in_table(pose)
    T, turn = table.base_from_table, Rotation.from_quat(moved[3:7], scalar_first=True).as_matrix()
    assert T[:3, :3] @ moved[:3] + T[:3, 3] == pytest.approx(np.array(place), abs=1e-9)
    there = Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()
    assert T[:3, :3] @ turn == pytest.approx(there, abs=1e-9)
    assert moved[7] == 0.03
    assert table.poses_in_table(np.stack([pose, pose])) == pytest.approx(np.stack([moved, moved]))


@given(PLACES, st.tuples(*[st.floats(-1, 1)] * 3))
def test_vectors_and_frames_come_back(table: TablePlace, vector: tuple[float, float, float]) -> None:
    v = np.array(vector)
    assert table.vector_in_table(table.vector_in_base(v)) == pytest.approx(v, abs=1e-12)
    assert table.vector_in_base(v) == pytest.approx(table.base_from_table[:3, :3] @ v, abs=1e-12)
    assert table.table_from_base @ table.base_from_table == pytest.approx(np.eye(4), abs=1e-12)


def test_what_points_up_in_the_one_frame_does_in_the_other() -> None:
    table = TablePlace(place_m=(0.1, 0.2, -0.15), turn_deg=77.0)
    assert table.vector_in_base(np.array([0.0, 0.0, 1.0])) == pytest.approx([0, 0, 1])


def test_a_camera_stands_where_it_did_and_comes_back() -> None:
    table, own = TablePlace(place_m=(0.3, -0.2, 0.15), turn_deg=90.0), camera()
    moved = table.camera_in_table(own)
    assert table.base_from_table @ moved.pose == pytest.approx(own.pose, abs=1e-12)
    x, y, z = own.deviation_m
    assert moved.deviation_m == pytest.approx((y, x, z))
    assert table.camera_in_base(moved).pose == pytest.approx(own.pose, abs=1e-12)


def test_where_the_arm_stands_on_the_table_nothing_changes() -> None:
    pose, own = pointing_down(np.array([0.4, 0.1, 0.2])), camera()
    assert AT_BASE.poses_in_table(pose) is pose
    assert AT_BASE.camera_in_table(own) is own
