"""Calibrated cameras: each stands where its calibration has it, and is still the camera that was calibrated."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from app.core.errors import DeviceError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import HandEye, Spread
from app.core.geometry.lens import Lens
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.memory import Identity
from app.rig.realsense.sdk.sources import Live
from app.rig.realsense.settings import StreamSettings

K = np.array([[605.0, 0.0, 319.5], [0.0, 604.0, 239.5], [0.0, 0.0, 1.0]])
POSE = np.array([[1.0, 0, 0, 0.3], [0, -1, 0, 0.1], [0, 0, -1, 0.8], [0, 0, 0, 1]])
FOUND = HandEye(
    serial="0123",
    setup="fixed",
    pose=POSE,
    board_pose=np.eye(4),
    lens=Lens(width=640, height=480, K=K),
    board=Charuco(columns=8, rows=6, square_m=0.03, marker_m=0.022, dictionary="5x5"),
    calibrated_at=date(2026, 11, 23),
    views=25,
    outliers=0,
    error_px=0.2,
    error_m=0.0005,
    error_deg=0.05,
    deviation_m=(2e-4, 2e-4, 2e-4),
    deviation_deg=(0.02, 0.02, 0.02),
    spread=Spread(turns_deg=(20.0, 15.0, 10.0), shifts_m=(0.1, 0.1, 0.05)),
)
IDENTITY = Identity(name="D435", serial="0123", firmware="5.16", usb="3.2", K=K, depth_unit_m=0.00025, warning="")


def test_a_calibrated_camera_is_on_the_bus_and_stands_where_its_calibration_has_it() -> None:
    mounted = Mounted.from_calibration(FOUND, name="left", settings=StreamSettings(width=1, height=1, rate_hz=15))
    assert mounted.source == Live(serial="0123")
    assert (mounted.settings.width, mounted.settings.height, mounted.settings.rate_hz) == (640, 480, 15)
    model = mounted.model(IDENTITY)
    assert (model.name, model.calibrated_at, model.depth_unit_m) == ("left", "2026-11-23", 0.00025)
    assert np.array_equal(model.T_world_camera, POSE)


def test_a_camera_with_other_intrinsics_than_it_was_calibrated_with_is_refused() -> None:
    mounted = Mounted.from_calibration(FOUND, name="left", settings=StreamSettings())
    assert mounted.model(replace(IDENTITY, K=K + 0.3)).K[0, 0] == pytest.approx(605.3)
    with pytest.raises(DeviceError, match=r"fx, fy, cx, cy = 611\.0, .* calibrated with 605\.0, .* calibrate it again"):
        mounted.model(replace(IDENTITY, K=K + 6.0))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (replace(FOUND, setup="wrist"), "on the wrist"),
        (replace(FOUND, lens=replace(FOUND.lens, distortion=(0.1, 0.0, 0.0, 0.0, 0.0))), "bends its image"),
    ],
    ids=["on the wrist", "of a lens that distorts"],
)
def test_a_calibration_that_is_not_of_such_a_camera_is_refused(wrong: HandEye, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        Mounted.from_calibration(wrong, name="left", settings=StreamSettings())
