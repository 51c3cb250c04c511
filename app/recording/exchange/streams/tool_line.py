"""Poses of a tool's tip over time, of poses of the frame that carries it."""

from typing import Final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError
from app.core.geometry.hand_eye import Three
from app.core.types import Poses
from app.recording.exchange.npz_import import Poseline

MISSING_TOOL: Final = (
    "nothing says where the tool was; in the file of --topics, name a stream of poses (tool.pose), a frame of /tf that "
    "moves with it (tool.frame), or joint positions and a description of the robot (tool.joints, tool.urdf)"
)
_FARTHEST_M: Final = 1e3
"""Distance beyond which a number is none of an arm; nearer ones are checked with the rest of what is imported."""
_UNIT: Final = 0.5
"""Least length of a quaternion."""


def line_of(times_s: Float64[np.ndarray, " T"], poses: Poses, tip_m: Three) -> Poseline:
    """The tip's poses in the order of their times, each time once. Raises RecordingError where one is out of reach."""
    times, first = np.unique(times_s, return_index=True)
    found = poses[first]
    bad = ~np.isfinite(found).all(axis=1) | (np.abs(found[:, :3]).max(axis=1, initial=0.0) > _FARTHEST_M)
    bad |= np.linalg.norm(found[:, 3:], axis=1) < _UNIT
    if bad.any():
        at = int(np.argmax(bad))
        raise RecordingError(
            f"The tool's pose at {times[at]:.3f} s is {found[at].tolist()}, which no arm reaches; give poses in metres "
            "in the base's frame, and leave out what was not measured."
        )
    turns = Rotation.from_quat(found[:, 3:], scalar_first=True)
    places = found[:, :3] + turns.apply(np.array(tip_m))
    return Poseline(times_s=times, poses=np.concatenate([places, found[:, 3:]], axis=1))
