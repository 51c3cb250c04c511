"""Check of an arm's configuration before this program moves it, and speed limits while it does.

The configuration is checked and never changed: the arm's owner sets it, in the arm's web page. The arm's own speed
limits are set, and restored on release.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.spatial.transform import Rotation

from app.config import Limits
from app.core.errors import DeviceError
from app.rig.kinova import gen3
from app.rig.kinova.api.codes import ControlMode
from app.rig.kinova.api.errors import LinkLost, Refused
from app.rig.kinova.api.messages import Pose
from app.rig.kinova.api.setup import GravityVector, ToolConfiguration
from app.rig.kinova.kortex import Kortex

_PAGE = "in the arm's web page, under Configurations"
_NEAR_M, _NEAR_RAD, _NEAR_KG = 0.001, np.radians(0.5), 0.1
"""Tolerances between configured and stated values: the accuracy of a ruler and a kitchen scale."""
_UPRIGHT_RAD = np.radians(2.0)
_TAKEN = 1e-3
"""Relative tolerance of limits that are read back: they travel as 32-bit floats."""


@final
@dataclass(frozen=True, kw_only=True)
class Holds:
    """End effector of an arm: a tip `tip_m` from the flange along its axis, its frame turned by `turn_deg` about that.

    `mass_kg`: total beyond the flange; None where unknown. The default is the delivered configuration of an arm with a
    Robotiq 2F-85. The fingers open along the x axis of the flange (ros_kortex, `robotiq_arg2f.xacro`); this program has
    them open along the y axis of the tool.
    """

    tip_m: float = gen3.GRIPPER_M
    turn_deg: float = 0.0
    mass_kg: float | None = None


DELIVERED: Final = Holds()


def check(kortex: Kortex, holds: Holds) -> None:
    """Raise DeviceError, naming the setting to change, where the configured tool or gravity differs from `holds`."""
    tool, payload, gravity = kortex.configuration()
    _check_upright(gravity)
    _check_frame(tool, holds)
    _check_mass(tool.tool_mass + payload.payload_mass, holds)


def _check_upright(gravity: GravityVector) -> None:
    down = np.array([gravity.x, gravity.y, gravity.z])
    if not -down[2] >= np.cos(_UPRIGHT_RAD) * np.linalg.norm(down) > 0:
        raise DeviceError(
            f"The arm has been told that things fall along {down.round(2).tolist()} in the frame of its base, and this "
            f"program takes it to stand upright on the table; mount it so, and set gravity {_PAGE}."
        )


def _check_frame(said: ToolConfiguration, holds: Holds) -> None:
    told = said.tool_transform or Pose()
    if not np.isfinite([told.x, told.y, told.z, told.theta_x, told.theta_y, told.theta_z]).all():
        raise DeviceError(f"The arm's tool frame is of numbers that are none; set the tool {_PAGE}.")
    frame = gen3.transform(told)
    wanted = gen3.transform(Pose(z=holds.tip_m, theta_z=holds.turn_deg))
    off_m = float(np.linalg.norm(frame[:3, 3] - wanted[:3, 3]))
    off_rad = Rotation.from_matrix(frame[:3, :3].T @ wanted[:3, :3]).magnitude()
    if off_m > _NEAR_M or off_rad > _NEAR_RAD:
        raise DeviceError(
            f"The arm's tool frame is {_pose_text(gen3.pose(frame))} from its flange, and this cell's tool is "
            f"{_pose_text(gen3.pose(wanted))} so that poses would be {1e3 * off_m:.0f} mm and "
            f"{np.degrees(off_rad):.0f} degrees off. Set the tool {_PAGE}, or say what it is in the cell's file, "
            "by tip_m and turn_deg of [arm.tool]."
        )


def _check_mass(believed_kg: float, holds: Holds) -> None:
    if holds.mass_kg is not None and not abs(believed_kg - holds.mass_kg) <= _NEAR_KG:
        raise DeviceError(
            f"The arm believes that {believed_kg:.2f} kg hang at its flange, and this cell's file says "
            f"{holds.mass_kg:.2f}: the force at the tool would be {9.81 * abs(believed_kg - holds.mass_kg):.0f} N off. "
            f"Set tool and payload {_PAGE}, or mass_kg of [arm.tool] in the cell's file."
        )


def _pose_text(pose: Pose) -> str:
    return (
        f"({pose.x:.3f}, {pose.y:.3f}, {pose.z:.3f}) m, turned by ({pose.theta_x:.0f}, {pose.theta_y:.0f}, "
        f"{pose.theta_z:.0f}) degrees,"
    )


@final
class OwnLimits:
    """Speed limits of the arm's tool: this site's from `set` to `restore`."""

    def __init__(self, kortex: Kortex) -> None:
        self._kortex = kortex
        self._before: Mapping[ControlMode, tuple[float, float]] = {}

    def set(self, limits: Limits) -> None:
        """Set the limits, remembering the arm's first ones. Raises DeviceError where the arm rejects them."""
        wanted = (limits.speed_m_s, float(np.degrees(limits.angular_speed_rad_s)))
        try:
            self._before = self._before or self._kortex.limits()
            self._kortex.limit(limits.speed_m_s, limits.angular_speed_rad_s)
            found = self._kortex.limits()
        except Refused as error:
            raise DeviceError(
                f"The arm does not take this site's limits as its own. {error} Its account is DIPAC_ARM_USER and "
                "DIPAC_ARM_PASSWORD of the environment."
            ) from None
        for mode, said in found.items():
            if not np.allclose(said, wanted, rtol=_TAKEN, atol=0.0):
                raise DeviceError(
                    f"The arm was told to move its tool at most at {wanted[0]:.3f} m/s and {wanted[1]:.1f} degrees/s, "
                    f"and says {said[0]:.3f} and {said[1]:.1f} of its mode {mode.name.lower()}; update its firmware."
                )

    def restore(self) -> None:
        """Restore the arm's own limits, as far as it can be reached. Never raises."""
        # Nothing more can be done about an arm that is gone or refuses: its limits stay lower than before.
        with contextlib.suppress(LinkLost, Refused):
            self._kortex.limit_as(self._before)
        self._before = {}
