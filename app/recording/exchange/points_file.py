"""Files of points: .npy, .npz and .ply, told apart by their first bytes. Pure."""

import io
import math
import zipfile
from typing import Final

import numpy as np

from app.core.errors import UsageError
from app.core.types import Cloud

SUFFIXES: Final = ("npy", "npz", "ply")
_MOST_POINTS: Final = 100_000
_MOST_BYTES: Final = 1 << 30
ADVICE: Final = "give one .npy, .npz or .ply file of points (M, 3) in metres"


def points_in(name: str, data: bytes) -> Cloud:
    """The points (M, 3) [m] in a file, thinned where very many; `name` is for the error.

    Raises UsageError where there are none, or one is not finite.
    """
    try:
        points = _read(data)
    except Exception as error:  # The file is untrusted, and its readers raise any error.
        why = str(error).splitlines()[:1]
        raise UsageError(f"Cannot read {name}: {why[0] if why else type(error).__name__}; {ADVICE}.") from None
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu" or not len(points):
        raise UsageError(f"{name} has shape {points.shape} of {points.dtype}; it must be points (M, 3) in metres.")
    with np.errstate(over="ignore", invalid="ignore"):  # What is beyond single precision is not finite, either.
        near = points.astype(np.float32)
    bad = ~np.isfinite(near).all(axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise UsageError(
            f"{name}: point {first}, {points[first].tolist()}, is not finite, as {int(bad.sum())} of {len(points)} "
            "are; leave out what was not measured."
        )
    return near[:: -(-len(points) // _MOST_POINTS)]


def _read(data: bytes) -> np.ndarray:
    if data.startswith(b"ply"):
        return _vertices(data)
    return _archived(data) if data.startswith(b"PK") else _array(data)


def _archived(data: bytes) -> np.ndarray:
    """The one array of an .npz file that could be points, or the one called `points`."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(each.file_size for each in archive.infolist()) > _MOST_BYTES:
            raise ValueError("it holds more than 1 GiB")
        names = [each for each in archive.namelist() if each.endswith(".npy")]
        arrays = {each.removesuffix(".npy"): _array(archive.read(each)) for each in names}
    fitting = {name: array for name, array in arrays.items() if array.ndim == 2 and array.shape[1] == 3}
    if "points" in fitting:
        return fitting["points"]
    if len(fitting) != 1:
        raise ValueError(f"of its arrays {', '.join(arrays) or 'none'}, one must be `points`")
    return next(iter(fitting.values()))


def _array(data: bytes) -> np.ndarray:
    """Array of a complete .npy file. Raises ValueError where it is shorter than its header says."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if math.prod(shape) * dtype.itemsize > len(data):
        raise ValueError("it is shorter than it says")
    stream.seek(0)
    return np.lib.format.read_array(stream, allow_pickle=False)


def _vertices(data: bytes) -> np.ndarray:
    import trimesh  # Few commands read a .ply file.

    loaded = trimesh.load(io.BytesIO(data), file_type="ply")
    return np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))))
