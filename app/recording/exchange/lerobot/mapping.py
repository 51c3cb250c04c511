"""Names of the features that this program writes, and the mapping by which `dipac import` reads them again."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from scipy.spatial.transform import Rotation

from app.core.geometry.camera import CameraModel
from app.recording.exchange.lerobot.samples import CameraImages, is_same_camera
from app.recording.exchange.streams.stream_map import CameraStreams, StreamMap, ToolStreams

STATE, ACTION, OBJECT, GOAL = "observation.state", "action", "observation.environment_state", "observation.goal"
IMAGE: Final = "observation.images."
MAPPING: Final = "topics.toml"
"""File of the mapping, in the dataset's folder."""
_DECIMALS: Final = 9


def depth_key(camera: str) -> str:
    """Feature of a camera's depth."""
    return f"{IMAGE}{camera}_depth"


def mapping(views: Sequence[tuple[str, Mapping[str, CameraImages]]], fps: int) -> StreamMap | None:
    """Mapping of a dataset whose episodes are of a task and of these cameras; None where they move or differ."""
    cameras = {name: it.camera for name, it in views[0][1].items()}
    for _, seen in views:
        for name, it in seen.items():
            first = cameras[name]
            if first is None or it.camera is None or not is_same_camera(first, it.camera):
                return None
    tasks = {task for task, _ in views}
    return StreamMap(
        base="base",
        tool=ToolStreams(pose=STATE, command=ACTION, command_ahead_s=1 / fps),
        cameras=tuple(
            _streams(camera, has_depth=bool(views[0][1][name].depth)) for name, camera in cameras.items() if camera
        ),
        about=MappingProxyType({"task": tasks.pop()} if len(tasks) == 1 else {}),
    )


def _streams(camera: CameraModel, *, has_depth: bool) -> CameraStreams:
    K, T = camera.K, camera.T_world_camera
    turn = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)
    return CameraStreams(
        name=camera.name,
        color=f"{IMAGE}{camera.name}",
        depth=depth_key(camera.name) if has_depth else "",
        intrinsics=(float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])),
        pose=tuple(round(value, _DECIMALS) for value in (*T[:3, 3].tolist(), *turn.tolist())),
        distortion=(0.0,) * 5,
    )
