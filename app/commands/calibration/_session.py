"""A folder of images of a board: `camera.toml`, the images, and `poses.csv` with the gripper's pose at each of them."""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from PIL import Image
from rich.console import Console
from rich.progress import track
from rich.text import Text
from scipy.spatial.transform import Rotation

from app.core.errors import PerceptionError, RecordingError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.lens import Lens
from app.core.types import ColourImage, Transform
from app.perception.calibration.se3 import transform
from app.perception.calibration.sight import BoardDetection, sight
from app.recording.exchange.calibration_file import load_lens

CAMERA, POSES = "camera.toml", "poses.csv"
_IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_COLUMNS = ("image", "x", "y", "z", "qw", "qx", "qy", "qz")
_UNIT = 1e-2
"""Tolerance on a quaternion's norm about 1: two digits were written, but none mistyped."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BoardImages:
    """A camera, its images in order, and their detections of the board; `unseen`: reasons for the others."""

    serial: str
    lens: Lens
    sights: Mapping[str, BoardDetection]
    unseen: Mapping[str, str]


def read_session(terminal: Console, folder: Path, board: Charuco, images: Sequence[str] | None = None) -> BoardImages:
    """Look for the board in the images, in all of the folder or those that are named.

    Raises UsageError where there is nothing to look at, RecordingError where a file is not what it should be.
    """
    serial, lens = load_lens(folder / CAMERA)
    names = (
        sorted(path.name for path in folder.iterdir() if path.suffix.lower() in _IMAGES) if images is None else images
    )
    if not names:
        raise UsageError(f"There is no image in {folder}; its files end in {', '.join(_IMAGES)}.")
    sights, unseen = dict[str, BoardDetection](), dict[str, str]()
    for name in track(names, "looking", console=terminal, transient=True):
        try:
            sights[name] = sight(_image(folder / name), board, lens)
        except PerceptionError as error:
            unseen[name] = str(error)
    for name, why in unseen.items():
        terminal.print(Text(f"{name} is left out: {why}", "yellow"))
    return BoardImages(serial=serial, lens=lens, sights=sights, unseen=unseen)


def read_poses(path: Path) -> dict[str, Transform]:
    """`T_world_gripper` at each image, of a table with a line for each: image, x, y, z [m], qw, qx, qy, qz.

    Raises UsageError where it cannot be read, RecordingError, which names the line, where it is no such table.
    """
    try:
        with path.open(encoding="utf-8", newline="") as lines:
            return dict(_poses(path, csv.DictReader(lines)))
    except OSError as error:
        raise UsageError(
            f"Cannot read the poses {path}: {error.strerror}; its first line is {','.join(_COLUMNS)}, then comes one "
            "for each image (docs/calibration-cameras.md)."
        ) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path} is no table of poses: {error}.") from None


def _poses(path: Path, rows: "csv.DictReader[str]") -> Iterator[tuple[str, Transform]]:
    if not rows.fieldnames or not set(_COLUMNS) <= set(rows.fieldnames):
        raise RecordingError(f"{path} must begin with a line that names its columns: {','.join(_COLUMNS)}.")
    for row in rows:
        try:
            x, y, z, *turn = (float(row[column]) for column in _COLUMNS[1:])
        except (TypeError, ValueError):
            raise RecordingError(f"{path}, line {rows.line_num}: seven numbers are needed after the image.") from None
        if not all(map(math.isfinite, (x, y, z, *turn))) or abs(math.hypot(*turn) - 1.0) > _UNIT:
            raise RecordingError(f"{path}, line {rows.line_num}: it is no pose; the quaternion must have length 1.")
        yield row["image"], transform(Rotation.from_quat(turn, scalar_first=True).as_matrix(), np.array([x, y, z]))


def _image(path: Path) -> ColourImage:
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise UsageError(f"Cannot read the image {path}: {error}.") from None
