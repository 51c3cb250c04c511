"""Recordings of the RealSense SDK made from rendered images, to be played like those of a real camera."""

import time
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from app.core.errors import RecordingError
from app.core.types import ColourImage, DepthImage
from app.rig.realsense.sdk.sdk import load_realsense
from app.rig.realsense.sdk.software import CameraDescription, SoftwareCamera

_SUFFIX = ".db3"
_KEPT = 4


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ImagerPair:
    """A pair of images of the two imagers, taken at `stamp_s` [s] of the calendar."""

    color: ColourImage
    depth: DepthImage
    stamp_s: float


def record(file: Path, body: CameraDescription, views: Iterable[ImagerPair]) -> int:
    """Write the recording that a camera with this `body` would make; returns the number of pairs.

    Blocks for as long as the views last by their stamps: the SDK dates its recording, for its pace in playing, by the
    clock of this machine. Raises RecordingError where the file exists, does not end in .db3, or cannot be written.
    """
    if file.suffix != _SUFFIX:
        raise RecordingError(f"{file} must end in {_SUFFIX}: the SDK plays nothing else.")
    if file.exists():
        raise RecordingError(f"{file} is there already; choose another name, or remove it.")
    rs = load_realsense()
    camera = SoftwareCamera(rs, body)
    try:
        with _recording(rs, file, camera.device):
            return _show_views(camera, views)
    except RuntimeError as error:
        raise RecordingError(f"{file} cannot be written: {error}.") from error


def _show_views(camera: SoftwareCamera, views: Iterable[ImagerPair]) -> int:
    """Show each view when it is due; returns their number."""
    count, ahead_s = 0, 0.0
    for view in views:
        ahead_s = ahead_s or time.time() - view.stamp_s
        time.sleep(max(0.0, view.stamp_s + ahead_s - time.time()))
        camera.show(view.color, view.depth, stamp_s=view.stamp_s)
        count += 1
    return count


def _recording(rs: Any, file: Path, device: Any) -> ExitStack:
    """Record the device's sensors until closed. The last reference to a recorder closes its file."""
    recorder, kept = rs.recorder(str(file), device), rs.frame_queue(_KEPT)
    ending = ExitStack()
    for sensor in recorder.query_sensors():
        sensor.open(sensor.get_stream_profiles())
        ending.callback(sensor.close)
        sensor.start(kept)
        ending.callback(sensor.stop)
    return ending
