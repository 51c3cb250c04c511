"""Frames of a recording's cameras over their common time span, decoded one by one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

import numpy as np
from mcap.reader import McapReader, make_reader

from app.core.errors import RecordingError
from app.core.geometry.camera import CameraModel
from app.core.messages import ArmState, Frame
from app.recording.format.index import Times, frame_times, log_times
from app.recording.format.integrity import DAMAGE, damage_error, inspect, reading, version_of
from app.recording.read.reader import logged_messages

_TOGETHER_NS: Final = 200_000_000
"""Difference of log times that counts as simultaneous."""
_NS: Final = 1_000_000_000


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Film:
    """Time span of the recording `path` covered by all its cameras: log times `first_ns` to `last_ns`.

    `cameras`: by name, as calibrated; `unseen_s`: seconds that each camera went on recording after the span.
    """

    path: Path
    cameras: Mapping[str, CameraModel]
    first_ns: int
    last_ns: int
    unseen_s: Mapping[str, float]
    version: int


def read_film(path: Path) -> Film:
    """The common span of a recording; decodes only the first frame of each camera.

    Raises as `read_messages`, and RecordingError where the cameras have no common moment.
    """
    version = version_of(inspect(path))
    with reading(path), path.open("rb") as stream:
        try:
            reader = make_reader(stream, validate_crcs=True)
            times = {name: each for name, each in frame_times(log_times(reader, stream)).items() if each}
            first_ns, last_ns = _span(path, times)
            cameras = {name: _camera(path, reader, version, name, times[name][0]) for name in sorted(times)}
        except DAMAGE as error:
            raise damage_error(path, error) from error
    return Film(
        path=path,
        cameras=cameras,
        first_ns=first_ns,
        last_ns=last_ns,
        unseen_s={name: (each[-1] - last_ns) / _NS for name, each in times.items() if each[-1] > last_ns},
        version=version,
    )


def film_frames(film: Film) -> Iterator[Frame]:
    """The frames in order of their log times, each decoded on demand.

    Each has a camera equal to that in `film.cameras`. Raises RecordingError where one is damaged, or its camera
    changed.
    """
    with reading(film.path), film.path.open("rb") as stream:
        try:
            reader, span = make_reader(stream, validate_crcs=True), {"first_ns": film.first_ns, "last_ns": film.last_ns}
            for logged in logged_messages(reader, (Frame,), film.version, **span):
                if isinstance(logged.message, Frame):
                    yield _of(film, logged.message)
        except DAMAGE as error:
            raise damage_error(film.path, error) from error


def film_states(film: Film) -> list[ArmState]:
    """States of the arm in the images over that span, in order, at the recorded rate. Raises as `film_frames`."""
    with reading(film.path), film.path.open("rb") as stream:
        try:
            logged = logged_messages(make_reader(stream, validate_crcs=True), (ArmState,), film.version)
            found = [each.message for each in logged if isinstance(each.message, ArmState)]
        except DAMAGE as error:
            raise damage_error(film.path, error) from error
    return sorted(found, key=lambda state: state.time_s)


def _span(path: Path, times: Times) -> tuple[int, int]:
    """First and last log time [ns] covered by all cameras. Raises RecordingError where there are none."""
    if not times:
        raise RecordingError(f"{path} holds no images, so there is nothing to see; `dipac recordings show {path}`.")
    first_ns = max(each[0] for each in times.values()) - _TOGETHER_NS
    last_ns = min(each[-1] for each in times.values()) + _TOGETHER_NS
    if not all(any(first_ns <= time <= last_ns for time in each) for each in times.values()):
        raise RecordingError(
            f"There is no time in {path} at which all its cameras looked ({', '.join(sorted(times))}); record them "
            "together."
        )
    return first_ns, last_ns


def _camera(path: Path, reader: McapReader, version: int, name: str, log_time_ns: int) -> CameraModel:
    """The camera of that name in its first complete frame from then on. Raises RecordingError where there is none."""
    for logged in logged_messages(reader, (Frame,), version, first_ns=log_time_ns):
        if isinstance(logged.message, Frame) and logged.message.camera.name == name:
            return logged.message.camera
    raise RecordingError(
        f"No image of camera {name!r} in {path} is whole; `dipac recordings check {path}` says what it lacks."
    )


def _of(film: Film, frame: Frame) -> Frame:
    """The frame with the film's own camera object. Raises RecordingError where its camera differs."""
    said = frame.camera
    known = film.cameras.get(said.name)
    if known is None or not _same(known, said) or frame.depth.shape != (known.height, known.width):
        raise RecordingError(
            f"Camera {said.name!r} is another one later in {film.path}, and a rig's cameras do not change; "
            "use a recording of one cell."
        )
    return replace(frame, camera=known)


def _same(one: CameraModel, other: CameraModel) -> bool:
    """True where both have equal intrinsics, pose and depth unit."""
    return (
        (one.width, one.height, one.depth_unit_m) == (other.width, other.height, other.depth_unit_m)
        and np.array_equal(one.K, other.K)
        and np.array_equal(one.T_world_camera, other.T_world_camera)
    )
