"""Pose of the table in the frame of an arm's base, and conversions between the two frames.

The program's world is the table's frame: z up from its surface. Parts that know only the base, an arm's driver and
calibrations of cameras, are converted here.
"""

from dataclasses import dataclass, replace
from typing import Final, TypeAlias, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.hand_eye import HandEye, Three
from app.core.types import Transform

_Vector: TypeAlias = Float64[np.ndarray, "3"]
_Poses: TypeAlias = Float64[np.ndarray, "*batch K"]


@final
@dataclass(frozen=True, kw_only=True)
class TablePlace:
    """The table's frame in the base's: its origin is at `place_m`, and it is turned by `turn_deg` about the vertical.

    A table is level: it is not tilted against the arm's base.
    """

    place_m: Three = (0.0, 0.0, 0.0)
    turn_deg: float = 0.0

    @property
    def base_from_table(self) -> Transform:
        """Transform from the table's frame to the base's."""
        T = np.eye(4)
        T[:3, :3] = self._turn.as_matrix()
        T[:3, 3] = self.place_m
        return T

    @property
    def table_from_base(self) -> Transform:
        """Transform from the base's frame to the table's."""
        T = np.eye(4)
        T[:3, :3] = self._turn.inv().as_matrix()
        T[:3, 3] = -T[:3, :3] @ self.place_m
        return T

    def vector_in_base(self, vector: _Vector) -> _Vector:
        """A velocity, angular velocity or force, rotated from the table's axes to those of the base."""
        return vector if self == AT_BASE else self._turn.apply(vector)

    def vector_in_table(self, vector: _Vector) -> _Vector:
        """The inverse of `vector_in_base`."""
        return vector if self == AT_BASE else self._turn.inv().apply(vector)

    def points_in_table(self, points: Float64[np.ndarray, "*batch 3"]) -> Float64[np.ndarray, "*batch 3"]:
        """Points [m] of the base's frame in the table's."""
        T = self.table_from_base
        return points if self == AT_BASE else points @ T[:3, :3].T + T[:3, 3]

    def poses_in_table(self, poses: _Poses) -> _Poses:
        """Poses (..., 7 or more: x y z, quaternion w x y z, ...) of the base's frame in the table's."""
        if self == AT_BASE:
            return poses
        moved = np.array(poses)
        moved[..., :3] = self.points_in_table(poses[..., :3])
        turns = (self._turn.inv() * Rotation.from_quat(poses[..., 3:7].reshape(-1, 4), scalar_first=True)).as_quat(
            scalar_first=True
        )
        # One fixed sign of the two, or a tool that points down would seem to jump.
        largest = np.take_along_axis(turns, np.abs(turns).argmax(1)[:, None], 1)
        moved[..., 3:7] = (turns * np.where(largest < 0, -1.0, 1.0)).reshape(poses[..., 3:7].shape)
        return moved

    def camera_in_table(self, found: HandEye) -> HandEye:
        """A camera calibrated in the base's frame, in the table's; unchanged where it is on the wrist."""
        return self._transform_camera(found, self.table_from_base)

    def camera_in_base(self, found: HandEye) -> HandEye:
        """The inverse of `camera_in_table`."""
        return self._transform_camera(found, self.base_from_table)

    @property
    def _turn(self) -> Rotation:
        return Rotation.from_euler("z", self.turn_deg, degrees=True)

    def _transform_camera(self, found: HandEye, T: Transform) -> HandEye:
        """Standard deviations along the new axes are computed as if the old ones were independent."""
        if self == AT_BASE or found.setup != "fixed":
            return found
        return replace(
            found,
            pose=T @ found.pose,
            deviation_m=_rotate_deviation(T, found.deviation_m),
            deviation_deg=_rotate_deviation(T, found.deviation_deg),
        )


def _rotate_deviation(T: Transform, deviation: Three) -> Three:
    x, y, z = np.sqrt(T[:3, :3] ** 2 @ np.square(deviation)).tolist()
    return x, y, z


AT_BASE: Final = TablePlace()
"""Identity placement: the arm stands on the table, and both frames are one."""
