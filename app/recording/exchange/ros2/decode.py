"""Messages of ROS 2 as arrays: images, compressed images, point clouds, poses. Pure.

Encodings are those of sensor_msgs/image_encodings.hpp; compressed depth is that of compressed_depth_image_transport.
"""

import math
import struct
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from app.core.types import ColourImage, DepthImage
from app.recording.exchange.image_file import colours_in
from app.recording.exchange.streams.rgbd import MM_M, Pinhole, millimetres

_COLOURS: Final[dict[str, tuple[int, int | None]]] = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "8UC3": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "8UC4": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB),
    "8UC1": (1, cv2.COLOR_GRAY2RGB),
    "uyvy": (2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422": (2, cv2.COLOR_YUV2RGB_UYVY),
    "yuyv": (2, cv2.COLOR_YUV2RGB_YUY2),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2RGB_YUY2),
    # OpenCV names a Bayer pattern by its second row.
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2RGB),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2RGB),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2RGB),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2RGB),
}
"""Bytes a pixel and the conversion to RGB, by encoding."""
_DEPTHS: Final = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
_DEPTH_HEADER: Final = 12
"""Bytes before the image of a compressed depth: format, and two numbers that quantise depth in metres."""
_PNG: Final = b"\x89PNG"
_FARTHEST_M: Final = 1e6
"""Bound of plausible coordinates [m], in maps of the earth as well."""
_FLOATS: Final = {7: "f4", 8: "f8"}
"""Types of a PointField that coordinates have."""


def is_depth_encoding(encoding: str) -> bool:
    """True for an encoding of depth images."""
    return encoding in _DEPTHS or "compressedDepth" in encoding


def colour_image(message: Any) -> ColourImage:
    """The pixels of an Image or a CompressedImage. Raises ValueError, which says what to do, where they are unknown."""
    if hasattr(message, "format"):
        return _compressed(message)
    if message.encoding not in _COLOURS:
        raise ValueError(
            f"its encoding {message.encoding!r} is not read; republish it as rgb8 (`ros2 run image_transport "
            f"republish raw`). Read are {', '.join(_COLOURS)}"
        )
    channels, conversion = _COLOURS[message.encoding]
    pixels = _rows(message, channels)
    return pixels if conversion is None else cv2.cvtColor(pixels, conversion).astype(np.uint8)


def depth_image(message: Any, unit_m: float) -> tuple[DepthImage, float]:
    """Depth, and its unit [m]: of whole numbers the unit given, of metres millimetres. Raises as `colour_image`."""
    if hasattr(message, "format"):
        return _compressed_depth(message, unit_m)
    if message.encoding not in _DEPTHS:
        raise ValueError(f"its encoding {message.encoding!r} is none of depth; read are {', '.join(_DEPTHS)}")
    kind = np.dtype(_DEPTHS[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    values = _rows(message, kind.itemsize).view(kind).reshape(message.height, message.width)
    return _in_units(values, unit_m)


def _in_units(values: np.ndarray, unit_m: float) -> tuple[DepthImage, float]:
    if values.dtype.kind == "f":
        return millimetres(values), MM_M
    return values.astype(np.uint16), unit_m or MM_M


def _rows(message: Any, pixel_bytes: int) -> UInt8[np.ndarray, "..."]:
    """Bytes (H, W, B) of an image, without what fills its rows. Raises ValueError where they do not fit."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, np.uint8)
    if not height or not width or step < width * pixel_bytes or len(data) < step * height:
        raise ValueError(
            f"it has {len(data)} bytes, and {width}x{height} pixels of {message.encoding} in rows of {step} need "
            f"{max(step, width * pixel_bytes) * height}; record it anew"
        )
    rows = data[: step * height].reshape(height, step)[:, : width * pixel_bytes]
    pixels = np.ascontiguousarray(rows).reshape(height, width, pixel_bytes)
    return pixels[..., 0] if pixel_bytes == 1 else pixels


def _compressed(message: Any) -> ColourImage:
    try:
        return colours_in(bytes(message.data))
    except (OSError, ValueError) as error:
        raise ValueError(
            f"its format {message.format!r} is no JPEG or PNG that can be read ({error}); republish it so (`ros2 run "
            "image_transport republish`), or record the raw topic"
        ) from None


def _compressed_depth(message: Any, unit_m: float) -> tuple[DepthImage, float]:
    data = bytes(message.data)
    transported = "compressedDepth" in message.format
    image = data[_DEPTH_HEADER:] if transported and not data.startswith(_PNG) else data
    values = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_UNCHANGED) if image else None
    if values is None or values.ndim != 2 or values.dtype != np.uint16:
        raise ValueError(
            f"its format {message.format!r} is no depth in PNG of 16 bits; set the transport's format to png, or "
            "record the raw topic"
        )
    if transported and message.format.startswith("32FC1"):
        _, a, b = struct.unpack_from("<iff", data)
        steps = values.astype(np.float64) - b
        return millimetres(np.divide(a, steps, out=np.zeros_like(steps), where=values > 0)), MM_M
    return _in_units(values, unit_m)


class CloudPoints(NamedTuple):
    """Points of a PointCloud2 [m], those that are finite, and their colours where it has any."""

    points: Float32[np.ndarray, "M 3"]
    colours: UInt8[np.ndarray, "M 3"] | None


def cloud_points(message: Any) -> CloudPoints:
    """The points of a PointCloud2. Raises ValueError where it has no coordinates that can be read."""
    fields = {it.name: it for it in message.fields}
    if any(axis not in fields or fields[axis].datatype not in _FLOATS for axis in "xyz"):
        raise ValueError(f"its fields are {', '.join(fields) or 'none'}; x, y and z as floats are needed")
    order = ">" if message.is_bigendian else "<"
    names, formats, offsets = list[str](), list[str](), list[int]()
    for axis in "xyz":
        names.append(axis)
        formats.append(order + _FLOATS[fields[axis].datatype])
        offsets.append(int(fields[axis].offset))
    colour = next((fields[name] for name in ("rgb", "rgba") if name in fields), None)
    if colour is not None:
        names.append("colour")
        formats.append(f"{order}u4")
        offsets.append(int(colour.offset))
    height, width, step, row = (int(getattr(message, name)) for name in ("height", "width", "point_step", "row_step"))
    data = np.asarray(message.data, np.uint8)
    if step <= max(offsets) or len(data) < height * row or row < width * step:
        raise ValueError(f"it has {len(data)} bytes, and {height}x{width} points of {step} bytes need more")
    rows = np.ascontiguousarray(data[: height * row].reshape(height, row)[:, : width * step])
    kind = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})
    found = rows.reshape(-1).view(kind)
    points = np.stack([found[axis].astype(np.float32) for axis in "xyz"], axis=1)
    kept = np.isfinite(points).all(axis=1)
    if colour is None:
        return CloudPoints(points[kept], None)
    packed = found["colour"][kept].astype(np.uint32)
    colours = np.stack([packed >> shift & 0xFF for shift in (16, 8, 0)], axis=1).astype(np.uint8)
    return CloudPoints(points[kept], colours)


def pinhole(info: Any, *, rectified: bool) -> Pinhole:
    """Optics of a CameraInfo; `rectified`: of images that were undistorted already. Raises ValueError without any."""
    P = np.array(info.p, np.float64).reshape(3, 4)
    K = P[:, :3] if rectified and P[0, 0] > 0 else np.array(info.k, np.float64).reshape(3, 3)
    distortion = () if rectified else tuple(float(each) for each in info.d)
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise ValueError("it is not calibrated (K is 0); calibrate the camera, or give its intrinsics")
    if any(distortion) and info.distortion_model not in ("plumb_bob", "rational_polynomial", ""):
        raise ValueError(
            f"its distortion model {info.distortion_model!r} is not read; record the rectified image (image_proc), or "
            "give intrinsics of an undistorted one"
        )
    return Pinhole(width=int(info.width), height=int(info.height), K=K, distortion=distortion)


def pose_of(place: Any, turn: Any) -> tuple[float, ...]:
    """Place x y z [m] and quaternion w x y z of a point (or a translation) and a quaternion.

    Raises ValueError where they are none.
    """
    numbers = [float(it) for it in (place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z)]
    length = math.hypot(*numbers[3:])
    if not (all(map(math.isfinite, numbers)) and max(map(abs, numbers)) < _FARTHEST_M and length > 0):
        raise ValueError(f"it is no pose: x y z = {numbers[:3]} m, quaternion w x y z = {numbers[3:]}")
    return (*numbers[:3], *(part / length for part in numbers[3:]))


def joint_positions(message: Any) -> dict[str, float]:
    """Positions of a JointState by joint [rad or m]."""
    return dict(zip(message.name, (float(it) for it in message.position), strict=False))
