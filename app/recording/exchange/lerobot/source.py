"""A LeRobot dataset (format v3) as measured episodes: its features as a list, their likeliest mapping, its episodes.

Files and fields are those of LeRobot's format v3.0: `meta/info.json`, `meta/episodes`, `data`, `videos`. The dataset
says of no camera where it is or how it sees; who imports images says both, but for datasets of this program, which
hold the mapping.
"""

import json
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, cast, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError
from app.core.types import Cloud, Poses
from app.recording.exchange.lerobot.mapping import GOAL, MAPPING
from app.recording.exchange.lerobot.rows import DatasetRows
from app.recording.exchange.lerobot.videos import Videos
from app.recording.exchange.streams.image_camera import ImageCamera
from app.recording.exchange.streams.measured_episode import MeasuredEpisode, SceneView
from app.recording.exchange.streams.robot_description import RobotDescription
from app.recording.exchange.streams.stream_list import StreamInfo, StreamList
from app.recording.exchange.streams.stream_map import (
    CameraStreams,
    CloudStream,
    StreamMap,
    ToolStreams,
    read_stream_map,
)
from app.recording.exchange.streams.tool_line import line_of

INFO: Final = "meta/info.json"
_VERSION: Final = "v3"
_PARTS: Final = ("x", "y", "z", "qw", "qx", "qy", "qz", "wx", "wy", "wz")
"""Numbers of a pose, by name: a place, and a quaternion or a rotation vector."""
_PART: Final = re.compile(r"(?:^|[._])(q?[wxyz]|w[xyz])(?:\.pos)?$")
_FEWEST: Final = 30
_DOWN: Final = (0.0, 1.0, 0.0, 0.0)


def is_dataset(path: Path) -> bool:
    """True for a folder that holds a LeRobot dataset, of any version."""
    return (path / INFO).is_file()


@final
class DatasetSource:
    """An opened dataset; see `ForeignSource`."""

    def __init__(self, path: Path) -> None:
        self._path, self._info = path, _info(path)
        self._features = cast(Mapping[str, Mapping[str, Any]], self._info["features"])
        self._fps = float(self._info["fps"])
        self._rows = DatasetRows(path, self._info)
        self._videos = Videos(path, self._info)

    @property
    def stream_list(self) -> StreamList:
        """List of the features."""
        info = self._info
        robot = info.get("robot_type") or "a robot that is not named"
        title = (
            f"{self._path}: a LeRobot dataset {info['codebase_version']} of {robot}, {info.get('total_episodes', '?')} "
            f"episodes, {info.get('total_frames', '?')} steps at {self._fps:g} a second."
        )
        total = info.get("total_frames")
        count = total if isinstance(total, int) else 0
        streams = [
            StreamInfo(name=name, kind=f"{it.get('dtype')} {_shape(it)}", count=count, detail=_detail(it))
            for name, it in sorted(self._features.items())
        ]
        notes = list[str]()
        if any(it.get("dtype") in ("image", "video") for it in self._features.values()):
            notes.append(
                "The format says of no camera where it is or how it sees: for images give intrinsics and pose below "
                "[[camera]]."
            )
        return StreamList(title=title, streams=tuple(streams), notes=tuple(notes))

    def guess(self) -> StreamMap:
        """Mapping that the dataset holds, or by names and shapes."""
        if (self._path / MAPPING).is_file():
            return read_stream_map(self._path / MAPPING)
        images = [name for name, it in sorted(self._features.items()) if it.get("dtype") in ("image", "video")]
        depths = [name for name in images if _is_depth(self._features[name]) or "depth" in name.rpartition(".")[2]]
        cameras = tuple(_camera(name, depths) for name in images if name not in depths)
        cloud = next((name for name, it in sorted(self._features.items()) if _is_cloud(name, it)), "")
        with_depth = tuple(camera for camera in cameras if camera.depth)
        return StreamMap(
            base="base",
            tool=self._tool(),
            cameras=with_depth or (() if cloud else cameras),
            cloud=CloudStream(topic=cloud, select=False) if cloud and not with_depth else None,
        )

    def episodes(self, streams: StreamMap) -> list[MeasuredEpisode]:
        """Every episode. Raises RecordingError, see `ForeignSource`."""
        streams.require(sorted(self._features), self._path)
        self._require_views(streams)
        if not streams.tool.pose and not streams.tool.joints:
            raise RecordingError(
                f"{self._path}: nothing says where the tool was; in the file of --topics name a feature of its pose as "
                'tool.pose (with components, such as ["x", "y", "z", "qw", "qx", "qy", "qz"]), or give '
                "tool.joints, tool.urdf (the robot's URDF) and tool.frame."
            )
        return [self._episode(number, streams) for number in self._rows.episodes]

    def _tool(self) -> ToolStreams:
        """The tool's poses: a feature whose components are named as those of one."""
        posed = [name for name, it in sorted(self._features.items()) if _pose_parts(_names(it))]
        state = next((name for name in posed if name.startswith("observation.")), "")
        command = "action" if "action" in posed else ""
        # Actions of the datasets that this program writes are commands of the next step.
        ahead_s = 1 / self._fps if command and GOAL in self._features else 0.0
        return ToolStreams(pose=state, command=command, command_ahead_s=ahead_s)

    def _require_views(self, streams: StreamMap) -> None:
        if streams.cloud is not None:
            return
        if not streams.cameras:
            raise RecordingError(
                f"{self._path} cannot be simulated: it has no image of the object and no points of it; needed are "
                "depth, or colour images of two cameras, with their intrinsics and poses in the file of --topics."
            )
        for camera in streams.cameras:
            if not camera.intrinsics or not camera.pose:
                raise RecordingError(
                    f"{self._path} cannot be simulated: nothing says where camera {camera.name!r} is and how it sees; "
                    "give intrinsics = [fx, fy, cx, cy] (pixels) and pose = [x, y, z, qw, qx, qy, qz] (m, in the "
                    "base's frame) below [[camera]] in the file of --topics."
                )

    def _episode(self, number: int, streams: StreamMap) -> MeasuredEpisode:
        tool = streams.tool
        times_s = self._rows.times(number)
        state = None
        if tool.pose:
            state = line_of(times_s, self._poses(number, tool.pose, tool), tool.tip_m)
        elif tool.joints:
            state = line_of(times_s, self._joint_poses(number, streams), tool.tip_m)
        command = None
        if tool.command:
            ahead_s = times_s + tool.command_ahead_s
            command = line_of(ahead_s, self._poses(number, tool.command, tool), tool.tip_m)
        look = self._cloud_at if streams.cloud is not None else self._images_at
        return MeasuredEpisode(state=state, command=command, moments_s=times_s, look=partial(look, streams, number))

    def _poses(self, number: int, name: str, tool: ToolStreams) -> Poses:
        """Poses in a feature of an episode, by the names of its components."""
        values = self._rows.numbers(number, name)
        names = tool.components or _pose_parts(_names(self._features[name]))
        if not {"x", "y", "z"} <= set(names):
            raise RecordingError(
                f"{self._path}: the components of {name} are {', '.join(_names(self._features[name])) or 'not named'}, "
                "so it is no pose that is known; give tool.components, in its order, of "
                f"{', '.join(_PARTS)} (and any other name for what is left out), or joint positions and a URDF: "
                "tool.joints, tool.urdf."
            )
        column = {part: index for index, part in enumerate(names) if index < values.shape[1]}
        places = values[:, [column[axis] for axis in "xyz"]]
        return np.concatenate([places, _turns(values, column)], axis=1)

    def _joint_poses(self, number: int, streams: StreamMap) -> Poses:
        tool = streams.tool
        values = self._rows.numbers(number, tool.joints)
        names = list(tool.components) or [name.removesuffix(".pos") for name in _names(self._features[tool.joints])]
        rows = [dict(zip(names, row, strict=False)) for row in values.tolist()]
        path = Path(tool.urdf)
        robot = RobotDescription.read(str(path if path.is_absolute() or path.exists() else self._path / path), None)
        return robot.poses(streams.base, tool.frame, rows, tool.joint_unit)

    def _cloud_at(self, streams: StreamMap, number: int, time_s: float) -> SceneView:
        assert streams.cloud is not None
        values = self._rows.numbers(number, streams.cloud.topic)
        row = values[int(np.argmin(np.abs(self._rows.times(number) - time_s)))]
        if len(row) % 3:
            raise RecordingError(
                f"{self._path}: {streams.cloud.topic} has {len(row)} numbers, which are no points x y z."
            )
        points: Cloud = row.reshape(-1, 3).astype(np.float32)
        return SceneView(points=points[np.isfinite(points).all(axis=1)], is_object=not streams.cloud.select)

    def _images_at(self, streams: StreamMap, number: int, time_s: float) -> SceneView:
        frames = [
            ImageCamera(streams=it).frame(
                time_s,
                self._image(number, it.color, time_s),
                self._depth(number, it.depth, time_s) if it.depth else None,
            )
            for it in streams.cameras
        ]
        return SceneView(frames=tuple(frames), points=np.zeros((0, 3), np.float32))

    def _image(self, number: int, name: str, time_s: float) -> Any:
        if self._features[name].get("dtype") == "video":
            return self._videos.color(name, self._rows.video_place(number, name), time_s)
        return self._rows.color(number, name, time_s)

    def _depth(self, number: int, name: str, time_s: float) -> Any:
        """Depth [m]."""
        if self._features[name].get("dtype") == "video":
            return self._videos.depth_m(name, self._rows.video_place(number, name), time_s)
        return self._rows.depth_m(number, name, time_s)


def _info(path: Path) -> Mapping[str, Any]:
    """`meta/info.json`. Raises RecordingError where it is none of this version."""
    try:
        info: Any = json.loads((path / INFO).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordingError(f"{path / INFO} cannot be read ({error}); download the dataset again.") from None
    version = info.get("codebase_version") if isinstance(info, dict) else None
    if not isinstance(version, str) or not version.startswith(_VERSION):
        raise RecordingError(
            f"{path} is a LeRobot dataset of version {version!r}; v3 is read. LeRobot converts it: `python -m "
            "lerobot.scripts.convert_dataset_v21_to_v30 --repo-id=NAME`."
        )
    features = info.get("features")
    if not isinstance(features, dict) or not all(isinstance(it, dict) for it in features.values()):
        raise RecordingError(f"{path / INFO} lists no features; download the dataset again.")
    if not isinstance(info.get("fps"), int | float) or not info["fps"] > 0:
        raise RecordingError(f"{path / INFO} says fps = {info.get('fps')!r}, which is no number of steps a second.")
    return cast(Mapping[str, Any], info)


def _shape(feature: Mapping[str, Any]) -> list[int]:
    """Shape of a feature's values; empty where it is not said."""
    shape: Any = feature.get("shape")
    whole = isinstance(shape, list) and all(isinstance(it, int) for it in shape)
    return [int(it) for it in shape] if whole else []


def _names(feature: Mapping[str, Any]) -> list[str]:
    """Names of a feature's components; also where they are in groups."""
    names: Any = feature.get("names")
    if isinstance(names, dict):
        groups = [it for it in names.values() if isinstance(it, list)]
        names = [name for group in groups for name in group]
    return [str(name) for name in names] if isinstance(names, list) else []


def _pose_parts(names: Sequence[str]) -> tuple[str, ...]:
    """The components' parts of a pose; empty where they are none of a pose."""
    found = tuple(match[1] if (match := _PART.search(name)) else name for name in names)
    return found if {"x", "y", "z"} <= set(found) and len(set(found)) == len(found) else ()


def _turns(values: Float64[np.ndarray, "S D"], column: Mapping[str, int]) -> Float64[np.ndarray, "S 4"]:
    """Quaternions w x y z; of a tool that points down where no turn is given."""
    if {"qw", "qx", "qy", "qz"} <= set(column):
        quaternions = values[:, [column[part] for part in ("qw", "qx", "qy", "qz")]]
        return quaternions / np.maximum(np.linalg.norm(quaternions, axis=1, keepdims=True), 1e-9)
    if {"wx", "wy", "wz"} <= set(column):
        turn = values[:, [column[part] for part in ("wx", "wy", "wz")]]
        return Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    return np.tile(_DOWN, (len(values), 1))


def _is_depth(feature: Mapping[str, Any]) -> bool:
    """True for a depth map, by any of the marks that LeRobot has had for it."""
    infos = [it for it in (feature.get("info"), feature.get("video_info")) if isinstance(it, dict)]
    return any(it.get("is_depth_map") or it.get("video.is_depth_map") for it in infos)


def _is_cloud(name: str, feature: Mapping[str, Any]) -> bool:
    shape = _shape(feature)
    return len(shape) == 1 and "environment_state" in name and shape[0] % 3 == 0 and shape[0] >= 3 * _FEWEST


def _camera(color: str, depths: Sequence[str]) -> CameraStreams:
    """A camera of colour images, with the depth that is called as it is."""
    name = color.rpartition(".")[2]
    plain = _plain_name(name)
    depth = next((it for it in depths if _plain_name(it.rpartition(".")[2]) == plain), "")
    return CameraStreams(name=name, color=color, depth=depth)


def _plain_name(name: str) -> str:
    return re.sub(r"_?(depth|rgb|color|image|img)_?", "", name)


def _detail(feature: Mapping[str, Any]) -> str:
    if feature.get("dtype") in ("image", "video"):
        return "depth" if _is_depth(feature) else ""
    return " ".join(_names(feature))[:100]
