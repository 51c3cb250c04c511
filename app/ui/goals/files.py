"""Goal files from a browser: validated strictly, and discarded where invalid. Pure."""

import io
from collections.abc import Mapping
from pathlib import PurePath
from typing import Final

import numpy as np
from PIL import Image

from app.core.errors import UsageError
from app.core.types import Cloud, ColourImage, DepthImage
from app.recording.exchange.image_file import colours_of
from app.recording.exchange.points_file import SUFFIXES, points_in

_PICTURES: Final = ("png", "jpg", "jpeg")
_MOST_PIXELS: Final = 4096 * 4096
_ADVICE: Final = (
    "give one .npy, .npz or .ply file of points [m], or a colour picture and a 16-bit depth picture of one camera"
)
_DEPTH_MODES: Final = ("I;16", "I;16L", "I")


def suffixes(files: Mapping[str, bytes]) -> list[str]:
    """Suffix of each file, in lower case and without a dot."""
    return [PurePath(name).suffix.lower().removeprefix(".") for name in files]


def are_points(files: Mapping[str, bytes]) -> bool:
    """True for one file of points, False for a pair of pictures. Raises UsageError for anything else."""
    kinds = suffixes(files)
    if len(kinds) == 1 and kinds[0] in SUFFIXES:
        return True
    if len(kinds) == 2 and all(kind in _PICTURES for kind in kinds):
        return False
    raise UsageError(f"{', '.join(files) or 'No file'}: {_ADVICE}.")


def points_of(files: Mapping[str, bytes]) -> Cloud:
    """The points (M, 3) [m] of the one file, thinned where very many. Raises UsageError where there are none."""
    ((name, data),) = files.items()
    return points_in(name, data)


def pictures_of(files: Mapping[str, bytes]) -> tuple[ColourImage, DepthImage]:
    """The colour and the depth picture of the two files, in either order. Raises UsageError where they are not such."""
    opened = {name: _open_picture(name, data) for name, data in files.items()}
    depth = [image for image in opened.values() if image.mode in _DEPTH_MODES]
    color = [image for image in opened.values() if image.mode not in _DEPTH_MODES]
    if len(depth) != 1 or len(color) != 1:
        raise UsageError(f"Of {', '.join(opened)} one must be a 16-bit depth picture and one in colour; {_ADVICE}.")
    try:
        ((name, picture),) = ((name, image) for name, image in opened.items() if image is color[0])
        return colours_of(picture, files[name]), np.array(depth[0]).astype(np.uint16)
    except (OSError, SyntaxError, ValueError) as error:
        raise UsageError(f"A picture is damaged ({error}); take it again.") from None


def _open_picture(name: str, data: bytes) -> Image.Image:
    """A picture with only its size read. Raises UsageError where it is not one, or too large."""
    try:
        image = Image.open(io.BytesIO(data), formats=("PNG", "JPEG"))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UsageError(f"{name} is no picture ({error}); {_ADVICE}.") from None
    if image.width * image.height > _MOST_PIXELS:
        raise UsageError(f"{name} has {image.width} x {image.height} pixels, which no camera here has; {_ADVICE}.")
    return image
