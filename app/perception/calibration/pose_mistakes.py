"""Usual mistakes in tables of gripper poses, found by trying them where the poses contradict the images."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Final, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.errors import PerceptionError
from app.perception.calibration.se3 import Transforms, inverse
from app.perception.calibration.solve import CalibrationView

Solve: TypeAlias = Callable[[Sequence[CalibrationView]], object]
"""Calibration from views. Raises PerceptionError where they contradict each other."""


def _reordered(poses: Transforms) -> Transforms:
    """The poses with quaternions x y z w that were read as w x y z."""
    numbers = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
    right = poses.copy()
    right[:, :3, :3] = Rotation.from_quat(numbers, scalar_first=False).as_matrix()
    return right


_MISTAKES: Final[Mapping[str, Callable[[Transforms], Transforms]]] = MappingProxyType(
    {
        "the quaternions are x, y, z, w under heads that say qw, qx, qy, qz: correct the heads": _reordered,
        # For the chain of transforms these two are the same.
        "they are poses of the base in the gripper's frame (give the inverse), or --setup is the other one": inverse,
        "each pose stands one row too late: move them up": lambda poses: np.roll(poses, -1, axis=0),
        "each pose stands one row too early: move them down": lambda poses: np.roll(poses, 1, axis=0),
    }
)


def likely_mistake(views: Sequence[CalibrationView], solve: Solve) -> str:
    """The mistake without which the views agree, in words; empty where none of the usual ones explains them."""
    poses = np.array([view.T_world_gripper for view in views])
    for words, right in _MISTAKES.items():
        corrected = [replace(view, T_world_gripper=pose) for view, pose in zip(views, right(poses), strict=True)]
        with suppress(PerceptionError):
            solve(corrected)
            return words
    return ""
