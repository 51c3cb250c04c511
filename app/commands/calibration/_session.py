"""A folder of images of a board: `camera.toml`, the images, and `poses.csv` with the gripper's pose at each of them."""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.text import Text
from scipy.spatial.transform import Rotation

from app.core.errors import PerceptionError, RecordingError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.lens import Lens
from app.core.types import Transform
from app.perception.calibration.se3 import transform
from app.perception.calibration.sight import BoardDetection, sight
from app.recording.exchange.calibration_file import load_lens
from app.recording.exchange.image_file import colours_in

CAMERA, POSES = "camera.toml", "poses.csv"
_IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_COLUMNS = ("image", "x", "y", "z", "qw", "qx", "qy", "qz")
_DELIMITERS = (",", ";", "\t")
_FARTHEST_M = 5.0
"""Distance from the base that no tabletop arm reaches."""
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
    paths = {name: _image_path(folder, name) for name in names}
    if not any(path.is_file() for path in paths.values()):
        raise UsageError(
            f"None of the images that {folder / POSES} names is there, {names[0]} first; correct the names."
        )
    for name, path in track(list(paths.items()), "looking", console=terminal, transient=True):
        try:
            sights[name] = sight(colours_in(path.read_bytes()), board, lens)
        except PerceptionError as error:
            unseen[name] = str(error)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else error
            unseen[name] = f"Cannot read the image {path}: {why}; take it again."
    for name, why in unseen.items():
        terminal.print(Text(f"{name} is left out: {why}", "yellow"))
    return BoardImages(serial=serial, lens=lens, sights=sights, unseen=unseen)


def read_poses(path: Path) -> dict[str, Transform]:
    """`T_world_gripper` at each image, of a table with a line for each: image, x, y, z [m], qw, qx, qy, qz.

    Raises UsageError where it cannot be read, RecordingError, which names the line, where it is no such table.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise UsageError(
            f"Cannot read the poses {path}: {error.strerror}; its first line is {','.join(_COLUMNS)}, then comes one "
            "for each image (docs/calibration-cameras.md)."
        ) from None
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is no table of poses in UTF-8 ({error.reason}); save it as CSV UTF-8.") from None
    try:
        poses = dict(_poses(path, text))
    except csv.Error as error:
        raise RecordingError(f"{path} is no table of poses: {error}.") from None
    if not poses:
        raise RecordingError(f"{path} holds no pose: give a line for each image below its heads.")
    return poses


def _poses(path: Path, text: str) -> Iterator[tuple[str, Transform]]:
    """Each row of the table, with commas, semicolons (and decimal commas) or tabs between its columns."""
    head = text.partition("\n")[0]
    delimiter = max(_DELIMITERS, key=head.count)
    rows = csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter)
    rows.fieldnames = [name.strip().lower() for name in rows.fieldnames or ()]
    missing = [column for column in _COLUMNS if column not in rows.fieldnames]
    if missing:
        raise RecordingError(
            f"{path} must begin with a line that names its columns, {','.join(_COLUMNS)}; there is no {missing[0]!r}."
        )
    for row in rows:
        try:
            x, y, z, *turn = (_number(row[column], delimiter) for column in _COLUMNS[1:])
        except (TypeError, ValueError, AttributeError):
            raise RecordingError(f"{path}, line {rows.line_num}: seven numbers are needed after the image.") from None
        if not all(map(math.isfinite, (x, y, z, *turn))) or abs(math.hypot(*turn) - 1.0) > _UNIT:
            raise RecordingError(f"{path}, line {rows.line_num}: it is no pose; the quaternion must have length 1.")
        if max(map(abs, (x, y, z))) > _FARTHEST_M:
            raise RecordingError(
                f"{path}, line {rows.line_num}: {x:g}, {y:g}, {z:g} m is out of every arm's reach; give metres, not "
                "millimetres."
            )
        yield (
            row["image"].strip(),
            transform(Rotation.from_quat(turn, scalar_first=True).as_matrix(), np.array([x, y, z])),
        )


def _number(text: str, delimiter: str) -> float:
    """A number of the table. Raises ValueError or AttributeError where it is none."""
    return float(text if delimiter == "," else text.replace(",", "."))


def _image_path(folder: Path, name: str) -> Path:
    """The image of this name; its folder or the end of its name may be another, or left out."""
    for path in (folder / name, folder / Path(name).name):
        if path.is_file():
            return path
        for suffix in _IMAGES:
            if (other := path.with_suffix(suffix)).is_file():
                return other
    return folder / name
