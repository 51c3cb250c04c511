"""Depth images as LeRobot stores them beside numbers: TIFF files of whole millimetres, or of metres.

Their feature says `is_depth_map` and `depth_unit`, as `lerobot.datasets.depth_utils` names both: 16 bits are
millimetres, 32 bits metres. 0 is no reading.
"""

import io
from collections.abc import Sequence
from typing import Final, Literal, TypeAlias

import numpy as np
import PIL.Image
from jaxtyping import Float32, Float64, UInt16

from app.core.geometry.camera import CameraModel

DepthUnit: TypeAlias = Literal["mm", "m"]

_MM_M: Final = 0.001
_PREDICTOR, _HORIZONTAL = 317, 2
"""Tag of TIFF 6.0, section 14: each pixel is stored as its difference from the one beside it, which packs better."""


def depth_unit(camera: CameraModel) -> DepthUnit:
    """Millimetres where the camera counts in them, so that nothing is rounded; metres else."""
    return "mm" if abs(camera.depth_unit_m - _MM_M) < 1e-9 else "m"


def depth_pixels(camera: CameraModel, depth: bytes) -> UInt16[np.ndarray, "height width"]:
    """Depth as recorded, in steps of the camera's unit."""
    return np.frombuffer(depth, "<u2").reshape(camera.height, camera.width)


def depth_tiff(camera: CameraModel, steps: UInt16[np.ndarray, "height width"]) -> bytes:
    """The depth image in the unit of `depth_unit`, packed without loss."""
    if depth_unit(camera) == "m":
        return _metres_tiff(steps * camera.depth_unit_m)
    stream = io.BytesIO()
    image = PIL.Image.fromarray(steps)
    image.save(stream, "TIFF", compression="tiff_adobe_deflate", tiffinfo={_PREDICTOR: _HORIZONTAL})
    return stream.getvalue()


def with_one_unit(files: Sequence[bytes], unit: DepthUnit) -> list[bytes]:
    """Files of `depth_tiff` in one unit: of "m" those of millimetres are turned into metres, and "mm" needs no other.

    Equal files stay equal.
    """
    if unit == "mm":
        return list(files)
    of = {data: _in_metres(data) for data in set(files)}
    return [of[data] for data in files]


def _in_metres(data: bytes) -> bytes:
    values = tiff_depth(data)
    return data if values.dtype.kind == "f" else _metres_tiff(values * _MM_M)


def _metres_tiff(depth_m: Float64[np.ndarray, "height width"]) -> bytes:
    stream = io.BytesIO()
    PIL.Image.fromarray(depth_m.astype(np.float32)).save(stream, "TIFF", compression="tiff_adobe_deflate")
    return stream.getvalue()


def tiff_depth(data: bytes) -> UInt16[np.ndarray, "height width"] | Float32[np.ndarray, "height width"]:
    """Inverse of `depth_tiff`: numbers in the unit of the file."""
    with PIL.Image.open(io.BytesIO(data)) as image:
        return np.asarray(image)
