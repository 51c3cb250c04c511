"""Foxglove views of each message: images, clouds, poses, lines and log lines in Foxglove's own schemas."""

from typing import Protocol, TypeAlias, runtime_checkable

import cv2
import numpy as np
from foxglove import Schema
from foxglove.messages import (
    CameraCalibration,
    CompressedImage,
    FrameTransform,
    FrameTransforms,
    Log,
    LogLevel,
    PackedElementField,
    PackedElementFieldNumericType,
    PointCloud,
    Pose,
    PoseInFrame,
    Quaternion,
    RawImage,
    Timestamp,
    Vector3,
)
from scipy.spatial.transform import Rotation

from app.core.geometry.camera import CameraModel
from app.core.messages import (
    ArmState,
    Decision,
    Executed,
    Fault,
    Frame,
    Goal,
    Message,
    Notice,
    Particles,
    Proposal,
    ResumeRequest,
    StopRequest,
)
from app.recording.format.channels import SURFACE_TOPIC, calibration_topic, color_topic, depth_topic
from app.recording.format.clock_offset import Epoch
from app.recording.write.scene import branch_lines, path_line


@runtime_checkable
class Viewable(Protocol):
    """A message in one of Foxglove's schemas."""

    @staticmethod
    def get_schema() -> Schema:
        """Its schema."""
        ...

    def encode(self) -> bytes:
        """Its bytes in that schema."""
        ...


View: TypeAlias = tuple[str, Viewable]
"""A topic and the Foxglove message for it."""

WORLD = "world"
_JPEG_QUALITY = 90
_XYZ = [
    PackedElementField(name=name, offset=4 * axis, type=PackedElementFieldNumericType.Float32)
    for axis, name in enumerate("xyz")
]


def views(message: Message, epoch: Epoch) -> list[View]:
    """The Foxglove messages to write along with `message`; none for messages of numbers only."""
    stamp = epoch.stamp(message.time_s)
    match message:
        case Frame():
            return _frame(message, stamp)
        case Particles():
            clouds: list[View] = [
                ("/object/particles", _cloud(message.positions, stamp)),
                (SURFACE_TOPIC, _cloud(message.surface, stamp)),
            ]
            if len(message.unseen):
                clouds.append(("/object/predicted", _cloud(message.unseen, stamp)))
            return clouds
        case Goal():
            return [("/goal", _cloud(message.positions, stamp))]
        case Proposal():
            return [
                ("/plan/predicted", _cloud(message.chosen.predicted, stamp)),
                ("/plan/branches", branch_lines(message, stamp, WORLD)),
            ]
        case ArmState():
            return _tool(message, stamp)
        case Executed():
            return [("/executed/path", path_line(message.made[:, :3], stamp, WORLD))]
        case _:
            return _log(message, stamp)


def _frame(frame: Frame, stamp: Timestamp) -> list[View]:
    camera = frame.camera
    T = camera.T_world_camera
    height, width = frame.depth.shape
    return [
        ("/tf", _transform(camera.name, T[:3, 3], Rotation.from_matrix(T[:3, :3]), stamp)),
        (calibration_topic(camera.name), _calibration(camera, stamp)),
        (
            color_topic(camera.name),
            CompressedImage(timestamp=stamp, frame_id=camera.name, data=_jpeg(frame.color), format="jpeg"),
        ),
        (
            depth_topic(camera.name),
            RawImage(
                timestamp=stamp,
                frame_id=camera.name,
                width=width,
                height=height,
                encoding="16UC1",
                step=2 * width,
                data=np.ascontiguousarray(frame.depth, dtype="<u2").tobytes(),
            ),
        ),
    ]


def _jpeg(color: np.ndarray) -> bytes:
    """An RGB image `(height, width, 3)` as JPEG. Raises ValueError where OpenCV cannot encode it."""
    done, data = cv2.imencode(".jpg", cv2.cvtColor(color, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not done:
        raise ValueError(f"an image of shape {color.shape} cannot be stored as JPEG")
    return data.tobytes()


def _calibration(camera: CameraModel, stamp: Timestamp) -> CameraCalibration:
    """A pinhole without distortion: images come rectified."""
    projection = np.hstack([camera.K, np.zeros((3, 1))])
    return CameraCalibration(
        timestamp=stamp,
        frame_id=camera.name,
        width=camera.width,
        height=camera.height,
        K=camera.K.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=projection.ravel().tolist(),
    )


def _cloud(points: np.ndarray, stamp: Timestamp) -> PointCloud:
    """Points [m] `(N, 3)` in the world frame."""
    data = np.ascontiguousarray(points, dtype="<f4").tobytes()
    origin = _pose(np.zeros(3), Rotation.identity())
    return PointCloud(timestamp=stamp, frame_id=WORLD, pose=origin, point_stride=12, fields=_XYZ, data=data)


def _tool(state: ArmState, stamp: Timestamp) -> list[View]:
    position, turn = state.pose[:3], Rotation.from_quat(state.pose[3:], scalar_first=True)
    return [
        ("/tool/pose", PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=_pose(position, turn))),
        ("/tf", _transform("tool", position, turn, stamp)),
    ]


def _pose(position: np.ndarray, turn: Rotation) -> Pose:
    return Pose(position=_vector(position), orientation=_quaternion(turn))


def _transform(child: str, position: np.ndarray, turn: Rotation, stamp: Timestamp) -> FrameTransforms:
    transform = FrameTransform(
        timestamp=stamp,
        parent_frame_id=WORLD,
        child_frame_id=child,
        translation=_vector(position),
        rotation=_quaternion(turn),
    )
    return FrameTransforms(transforms=[transform])


def _vector(position: np.ndarray) -> Vector3:
    x, y, z = position.tolist()
    return Vector3(x=x, y=y, z=z)


def _quaternion(turn: Rotation) -> Quaternion:
    x, y, z, w = turn.as_quat().tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def _log(message: Message, stamp: Timestamp) -> list[View]:
    """Line of Foxglove's log panel for an event or a request."""
    match message:
        case Notice():
            level, name, text = LogLevel.Info, message.where, message.text
        case Fault():
            level, name, text = LogLevel.Fatal if message.fatal else LogLevel.Error, message.where, message.text
        case StopRequest():
            level, name, text = LogLevel.Warning, "operator", f"{message.operator} pressed STOP"
        case ResumeRequest():
            level, name, text = LogLevel.Info, "operator", f"{message.operator} asked to go on"
        case Decision():
            verdict = "approved" if message.approve else "rejected"
            level, name, text = LogLevel.Info, "operator", f"{message.operator} {verdict} {message.proposal_id}"
        case _:
            return []
    return [("/log", Log(timestamp=stamp, level=level, message=text, name=name))]
