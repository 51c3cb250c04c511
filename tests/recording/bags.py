"""Bags of ROS 2 of a rope that is pushed, written by the library that reads them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, final

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from tests.recording.rope_scene import HEIGHT, WIDTH, K, RopeScene, camera_pose, poses

Storage: TypeAlias = Literal["mcap", "sqlite3"]
START_NS = 1_764_000_000_000_000_000
NS = 1_000_000_000
COLOR, INFO = "/front/color/image_raw", "/front/color/camera_info"
DEPTH = "/front/aligned_depth_to_color/image_raw"
OPTICAL = "front_color_optical_frame"
POSE, TARGET = "/tool_pose", "/target_pose"
CLOUD = "/object_points"
Event: TypeAlias = tuple[float, str, str, Any]
"""Time [s], topic, type and message."""


@final
@dataclass(frozen=True, kw_only=True)
class BagWriter:
    """Messages as ROS has them, and a bag of them. `compress`: each message by itself."""

    storage: Storage = "mcap"
    compress: bool = False

    def write(self, path: Path, events: list[Event]) -> Path:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if self.storage == "mcap" else StoragePlugin.SQLITE3
        types = typestore()
        writer = Writer(path, version=9, storage_plugin=plugin)
        if self.compress:
            writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        with writer:
            connections: dict[str, Any] = {}
            for time_s, topic, kind, message in sorted(events, key=lambda event: event[0]):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=types)
                if message is None:
                    continue
                now_ns = START_NS + round(time_s * NS)
                writer.write(connections[topic], now_ns, types.serialize_cdr(message, kind))
        return path


def typestore() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.LATEST)


def header(time_s: float, frame: str, late_s: float = 0.0) -> Any:
    types = typestore().types
    stamp_ns = START_NS + round((time_s - late_s) * NS)
    return types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=stamp_ns // NS, nanosec=stamp_ns % NS), frame_id=frame
    )


def image(time_s: float, frame: str, pixels: np.ndarray, encoding: str, late_s: float = 0.0) -> Any:
    height, width = pixels.shape[:2]
    data = np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8)
    return typestore().types["sensor_msgs/msg/Image"](
        header=header(time_s, frame, late_s),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=len(data) // height,
        data=data,
    )


def compressed(time_s: float, frame: str, data: bytes, form: str) -> Any:
    return typestore().types["sensor_msgs/msg/CompressedImage"](
        header=header(time_s, frame), format=form, data=np.frombuffer(data, np.uint8)
    )


def camera_info(
    time_s: float, frame: str, *, distortion: tuple[float, ...] = (0.0,) * 5, model: str = "plumb_bob"
) -> Any:
    types = typestore().types
    return types["sensor_msgs/msg/CameraInfo"](
        header=header(time_s, frame),
        height=HEIGHT,
        width=WIDTH,
        distortion_model=model,
        d=np.array(distortion),
        k=K.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([K, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def _vector(kind: str, values: np.ndarray) -> Any:
    x, y, z = (float(each) for each in values)
    return typestore().types[f"geometry_msgs/msg/{kind}"](x=x, y=y, z=z)


def _quaternion(wxyz: np.ndarray) -> Any:
    w, x, y, z = (float(each) for each in wxyz)
    return typestore().types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)


def transform(time_s: float, parent: str, child: str, pose: np.ndarray) -> Any:
    """A message of one transform."""
    types = typestore().types
    one = types["geometry_msgs/msg/TransformStamped"](
        header=header(time_s, parent),
        child_frame_id=child,
        transform=types["geometry_msgs/msg/Transform"](
            translation=_vector("Vector3", pose[:3]), rotation=_quaternion(pose[3:])
        ),
    )
    return types["tf2_msgs/msg/TFMessage"](transforms=[one])


def pose_stamped(time_s: float, frame: str, pose: np.ndarray, late_s: float = 0.0) -> Any:
    types = typestore().types
    return types["geometry_msgs/msg/PoseStamped"](
        header=header(time_s, frame, late_s),
        pose=types["geometry_msgs/msg/Pose"](position=_vector("Point", pose[:3]), orientation=_quaternion(pose[3:])),
    )


def joint_state(time_s: float, names: list[str], positions: list[float]) -> Any:
    return typestore().types["sensor_msgs/msg/JointState"](
        header=header(time_s, ""),
        name=names,
        position=np.array(positions),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )


def text(words: str) -> Any:
    return typestore().types["std_msgs/msg/String"](data=words)


def point_cloud(time_s: float, frame: str, points: np.ndarray, colours: np.ndarray | None = None) -> Any:
    types = typestore().types
    names = ["x", "y", "z", *(["rgb"] if colours is not None else [])]
    fields = [
        types["sensor_msgs/msg/PointField"](name=name, offset=4 * k, datatype=7, count=1)
        for k, name in enumerate(names)
    ]
    rows = np.zeros((len(points), len(names)), np.float32)
    rows[:, :3] = points
    if colours is not None:
        packed = colours.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
        rows[:, 3] = packed.astype(np.uint32).view(np.float32)
    data = np.frombuffer(rows.tobytes(), np.uint8)
    return types["sensor_msgs/msg/PointCloud2"](
        header=header(time_s, frame),
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=rows.strides[0],
        row_step=len(data),
        data=data,
        is_dense=True,
    )


def camera_place() -> np.ndarray:
    """Pose of the camera in the base's frame."""
    T = camera_pose()
    return np.concatenate([T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)])


def static_camera() -> Event:
    return 0.0, "/tf_static", "tf2_msgs/msg/TFMessage", transform(0.0, "base_link", OPTICAL, camera_place())


def tool_transforms(scene: RopeScene) -> Iterator[Event]:
    times, places = scene.tool()
    for time_s, pose in zip(times.tolist(), poses(places), strict=True):
        yield time_s, "/tf", "tf2_msgs/msg/TFMessage", transform(time_s, "base_link", "tool0", pose)


def tool_poses(scene: RopeScene, topic: str = POSE, late_s: float = 0.0) -> Iterator[Event]:
    times, places = scene.tool()
    for time_s, pose in zip(times.tolist(), poses(places), strict=True):
        yield time_s, topic, "geometry_msgs/msg/PoseStamped", pose_stamped(time_s, "base_link", pose, late_s)


def images(
    scene: RopeScene,
    *,
    depth: bool = True,
    color_of: Callable[[np.ndarray], tuple[np.ndarray, str]] = lambda pixels: (pixels, "rgb8"),
    late_s: float = 0.0,
) -> Iterator[Event]:
    """Colours, aligned depth in millimetres, and the camera's optics."""
    kind = "sensor_msgs/msg/Image"
    for time_s in scene.image_times().tolist():
        color, away = scene.images(time_s)
        pixels, encoding = color_of(color)
        yield time_s, COLOR, kind, image(time_s, OPTICAL, pixels, encoding, late_s)
        yield time_s, INFO, "sensor_msgs/msg/CameraInfo", camera_info(time_s, OPTICAL)
        if depth:
            steps = np.round(1000 * away).astype(np.uint16)
            yield time_s, DEPTH, kind, image(time_s, OPTICAL, steps, "16UC1", late_s)


def compressed_images(scene: RopeScene) -> Iterator[Event]:
    """The same, compressed by image_transport: JPEG, and depth as PNG behind twelve bytes."""
    kind = "sensor_msgs/msg/CompressedImage"
    for time_s in scene.image_times().tolist():
        color, away = scene.images(time_s)
        jpeg = cv2.imencode(".jpg", color[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
        png = cv2.imencode(".png", np.round(1000 * away).astype(np.uint16))[1].tobytes()
        yield time_s, f"{COLOR}/compressed", kind, compressed(time_s, OPTICAL, jpeg, "rgb8; jpeg compressed bgr8")
        yield (
            time_s,
            f"{DEPTH}/compressedDepth",
            kind,
            compressed(time_s, OPTICAL, bytes(12) + png, "16UC1; compressedDepth png"),
        )
        yield time_s, INFO, "sensor_msgs/msg/CameraInfo", camera_info(time_s, OPTICAL)


def clouds(scene: RopeScene) -> Iterator[Event]:
    for time_s in scene.image_times().tolist():
        cloud = point_cloud(time_s, "base_link", scene.surface(time_s))
        yield time_s, CLOUD, "sensor_msgs/msg/PointCloud2", cloud
