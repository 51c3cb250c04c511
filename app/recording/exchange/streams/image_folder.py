"""A folder of images, or of files of points, with the tool's pose at each: `poses.csv` names them, a row a moment.

Columns are `time` [s], `x`, `y`, `z` [m], `qw`, `qx`, `qy`, `qz` of the tool in the base's frame; and files seen at
that time, empty where there is none: `image` and `depth`, or `image_NAME` and `depth_NAME` of several cameras, or
`points`. A column `episode` counts runs.
"""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final, final

import cv2
import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError, UsageError
from app.core.types import ColourImage
from app.recording.exchange.calibration_file import load_cameras
from app.recording.exchange.image_file import colours_in
from app.recording.exchange.points_file import points_in
from app.recording.exchange.streams.image_camera import ImageCamera
from app.recording.exchange.streams.measured_episode import MeasuredEpisode, SceneView
from app.recording.exchange.streams.rgbd import MM_M
from app.recording.exchange.streams.stream_list import StreamInfo, StreamList
from app.recording.exchange.streams.stream_map import CameraStreams, CloudStream, StreamMap, ToolStreams
from app.recording.exchange.streams.tool_line import line_of

POSES: Final = "poses.csv"
_CALIBRATION: Final = "calibration.toml"
_NUMBERS: Final = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
_DELIMITERS: Final = (",", ";", "\t")
_UNIT: Final = 1e-2
"""Tolerance of a quaternion's length about 1."""
_POINTS: Final = "points"


def is_image_folder(path: Path) -> bool:
    """True for a folder with a `poses.csv`."""
    return (path / POSES).is_file()


@final
@dataclass(frozen=True, kw_only=True)
class _Row:
    """A moment: time [s], pose, and the files seen, by column."""

    episode: str
    numbers: tuple[float, ...]
    files: Mapping[str, str]


@final
class ImageFolder:
    """The folder at `path`; see `ForeignSource`."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @cached_property
    def _rows(self) -> list[_Row]:
        return list(_rows(self._path / POSES))

    @cached_property
    def _columns(self) -> list[str]:
        """Columns of files that are not empty."""
        return [name for name in self._rows[0].files if any(row.files[name] for row in self._rows)]

    @property
    def stream_list(self) -> StreamList:
        """List of the columns."""
        episodes = len({row.episode for row in self._rows})
        streams = [
            StreamInfo(
                name=name,
                kind="files of points" if name == _POINTS else "depth images" if _is_depth(name) else "colour images",
                count=sum(bool(row.files[name]) for row in self._rows),
                detail=next(row.files[name] for row in self._rows if row.files[name]),
            )
            for name in self._columns
        ]
        title = f"{self._path}: a folder of files with poses, {len(self._rows)} moments in {episodes} episodes."
        tool = StreamInfo(name="pose", kind="tool's poses", count=len(self._rows))
        return StreamList(title=title, streams=(tool, *streams))

    def guess(self) -> StreamMap:
        """Mapping by the columns' names; cameras are placed by the folder's calibration.toml."""
        images = [name for name in self._columns if name != _POINTS and not _is_depth(name)]
        cameras = tuple(self._camera(name) for name in images)
        by_points = _POINTS in self._columns and not any(camera.depth for camera in cameras)
        return StreamMap(
            base="base",
            tool=ToolStreams(pose="pose"),
            cameras=() if by_points else cameras,
            cloud=CloudStream(topic=_POINTS, select=False) if by_points else None,
        )

    def episodes(self, streams: StreamMap) -> list[MeasuredEpisode]:
        """Each run. Raises RecordingError, see `ForeignSource`."""
        streams.require(["pose", *self._columns], self._path)
        for camera in streams.cameras:
            if not camera.intrinsics or not camera.pose:
                raise RecordingError(
                    f"{self._path}: nothing says where camera {camera.name!r} is and how it sees; put the "
                    f"{_CALIBRATION} of `dipac calibration solve` into the folder, or give intrinsics = [fx, fy, cx, "
                    "cy] and pose = [x, y, z, qw, qx, qy, qz] below [[camera]] in the file of --topics."
                )
        if streams.cloud is None and not streams.cameras:
            raise RecordingError(
                f"{self._path / POSES} names no image and no file of points; add columns image and depth, or points."
            )
        numbers = list(dict.fromkeys(row.episode for row in self._rows))
        return [self._episode([row for row in self._rows if row.episode == it], streams) for it in numbers]

    def _episode(self, rows: Sequence[_Row], streams: StreamMap) -> MeasuredEpisode:
        table = np.array([row.numbers for row in rows])
        wanted = (
            [streams.cloud.topic]
            if streams.cloud
            else [name for it in streams.cameras for name in (it.color, it.depth) if name]
        )
        seen = [row for row in rows if all(row.files[name] for name in wanted)]
        times_s = np.array([row.numbers[0] for row in seen])
        return MeasuredEpisode(
            state=line_of(table[:, 0], table[:, 1:], streams.tool.tip_m),
            command=None,
            moments_s=times_s,
            look=partial(self._look, {row.numbers[0]: row for row in seen}, streams),
        )

    def _look(self, rows: Mapping[float, _Row], streams: StreamMap, time_s: float) -> SceneView:
        row = rows[time_s]
        if streams.cloud is not None:
            points = points_in(row.files[streams.cloud.topic], self._read(row.files[streams.cloud.topic]))
            return SceneView(points=points, is_object=not streams.cloud.select)
        frames = [
            ImageCamera(streams=it).frame(
                time_s,
                self._color(row.files[it.color]),
                self._depth_m(row.files[it.depth], it.depth_unit_m or MM_M) if it.depth else None,
            )
            for it in streams.cameras
        ]
        return SceneView(frames=tuple(frames), points=np.zeros((0, 3), np.float32))

    def _camera(self, color: str) -> CameraStreams:
        """The camera of a column, as calibration.toml has it."""
        name = color.partition("_")[2] or "camera"
        depth = "depth" + color.removeprefix("image")
        camera = CameraStreams(name=name, color=color, depth=depth if depth in self._columns else "")
        file = self._path / _CALIBRATION
        known = load_cameras(file) if file.is_file() else {}
        found = known.get(name) or (next(iter(known.values())) if len(known) == 1 else None)
        if found is None or found.setup != "fixed":
            return camera
        lens, turn = found.lens, Rotation.from_matrix(found.pose[:3, :3]).as_quat(scalar_first=True)
        return CameraStreams(
            name=name,
            color=color,
            depth=camera.depth,
            pose=(*found.pose[:3, 3].tolist(), *turn.tolist()),
            intrinsics=(float(lens.K[0, 0]), float(lens.K[1, 1]), float(lens.K[0, 2]), float(lens.K[1, 2])),
            distortion=tuple(lens.distortion) if any(lens.distortion) else (),
        )

    def _read(self, name: str) -> bytes:
        try:
            return (self._path / name).read_bytes()
        except OSError as error:
            raise RecordingError(
                f"{self._path / POSES} names {name}, which cannot be read ({error.strerror}); correct the name, or "
                "leave it empty."
            ) from None

    def _color(self, name: str) -> ColourImage:
        try:
            return colours_in(self._read(name))
        except (OSError, ValueError) as error:
            raise RecordingError(f"{self._path / name} is no image that can be read ({error}); leave it out.") from None

    def _depth_m(self, name: str, unit_m: float) -> Float64[np.ndarray, "height width"]:
        """Depth [m] of an image of 16 bits in steps of `unit_m`, or of an array (.npy) in metres."""
        data = self._read(name)
        values: Any = None
        if data.startswith(np.lib.format.MAGIC_PREFIX):
            try:
                values = np.load(io.BytesIO(data), allow_pickle=False)
            except (ValueError, EOFError):
                values = None
        elif data:
            values = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if values is None or values.ndim != 2 or values.dtype.itemsize < 2:
            raise RecordingError(
                f"{self._path / name} is no depth: an image of one channel and 16 bits, or an array (.npy) of metres, "
                "is needed; write it so, or leave the column out."
            )
        return values.astype(np.float64) * (1.0 if values.dtype.kind == "f" else unit_m)


def _is_depth(column: str) -> bool:
    return column.startswith("depth")


def _rows(path: Path) -> Iterator[_Row]:
    """Rows of the table. Raises UsageError where it cannot be read, RecordingError, with the line, where it is none."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise UsageError(f"Cannot read {path}: {error.strerror}.") from None
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is no table in UTF-8 ({error.reason}); save it as CSV UTF-8.") from None
    delimiter = max(_DELIMITERS, key=text.partition("\n")[0].count)
    rows = csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        rows.fieldnames = [name.strip().lower() for name in rows.fieldnames or ()]
        yield from _check_rows(path, rows, delimiter)
    except csv.Error as error:
        raise RecordingError(f"{path} is no table: {error}.") from None


def _check_rows(path: Path, rows: "csv.DictReader[str]", delimiter: str) -> Iterator[_Row]:
    names = list(rows.fieldnames or ())
    missing = [name for name in _NUMBERS if name not in names]
    if missing:
        raise RecordingError(
            f"{path} must begin with a line that names its columns, {','.join(_NUMBERS)} and those of files; there is "
            f"no {missing[0]!r}."
        )
    files, last_s, count = [it for it in names if it not in (*_NUMBERS, "episode")], dict[str, float](), 0
    for row in rows:
        place, count = f"{path}, line {rows.line_num}", count + 1
        try:
            numbers = tuple(_number(row[name], delimiter) for name in _NUMBERS)
        except (TypeError, ValueError, AttributeError):
            raise RecordingError(f"{place}: eight numbers are needed, {','.join(_NUMBERS)}.") from None
        if not all(map(math.isfinite, numbers)) or abs(math.hypot(*numbers[4:]) - 1) > _UNIT:
            raise RecordingError(f"{place}: it is no pose; the quaternion must have length 1.")
        episode = (row.get("episode") or "").strip()
        if numbers[0] <= last_s.get(episode, -math.inf):
            raise RecordingError(
                f"{place}: {numbers[0]:g} s is not after the row before; give the rows in their order."
            )
        last_s[episode] = numbers[0]
        yield _Row(episode=episode, numbers=numbers, files={it: (row[it] or "").strip() for it in files})
    if not count:
        raise RecordingError(f"{path} holds no row; give one for each moment, below its heads.")


def _number(text: str, delimiter: str) -> float:
    """A number of the table, with a decimal comma where that separates no columns."""
    return float(text if delimiter == "," else text.replace(",", "."))
