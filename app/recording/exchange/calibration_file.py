"""Camera calibrations in a TOML file, by serial number: written by `dipac calibration solve` and by the console."""

import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from types import MappingProxyType
from typing import Any, final

import numpy as np
import tomli_w
from anyio import to_thread
from scipy.spatial.transform import Rotation

from app.core.errors import DipacError, RecordingError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import Agreement, HandEye, LastCheck, Setup, Spread, Three
from app.core.geometry.lens import Lens
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.system.disk import replacement
from app.core.types import Transform
from app.recording.exchange.toml_file import finite_number, read_toml, refuse_unknown

SCHEMA = 1
FILE = Path("calibration.toml")
"""Default path of the file."""
_SETUPS: Mapping[str, Setup] = {"fixed": "fixed", "wrist": "wrist"}
_AGREEMENTS: Mapping[str, Agreement] = {"agrees": "agrees", "differs": "differs", "open": "open"}
_UNIT = 1e-3
"""Tolerance of a quaternion's length about 1: admits rounding by hand, and rejects typing errors."""
_LARGEST_PX = 20_000
_INTRINSICS = ("width", "height", "fx", "fy", "cx", "cy", "distortion")


@final
class CalibrationFile:
    """The file as a store of calibrations; reading and writing stay off the event loop.

    `serials`: serial numbers of the cameras that a cell names itself, by those names. `table`: pose of the cell's
    table; the file has cameras in the frame of the arm's base, and the program in the table's.
    """

    def __init__(
        self, path: Path = FILE, serials: Mapping[str, str] = MappingProxyType({}), table: TablePlace = AT_BASE
    ) -> None:
        self._path, self._serials, self._table = path, serials, table

    async def kept(self, serial: str) -> HandEye | None:
        """Calibration of the camera, None where the file has none. Raises RecordingError where the file is invalid."""
        own = self._serials.get(serial, serial)
        found = (await to_thread.run_sync(known_cameras, self._path)).get(own)
        return None if found is None else self._table.camera_in_table(found)

    async def keep(self, found: HandEye) -> Path:
        """Write it into the file, as `save_camera`."""
        serial = self._serials.get(found.serial, found.serial)
        there = self._table.camera_in_base(replace(found, serial=serial))
        await to_thread.run_sync(save_camera, self._path, there)
        return self._path


def save_camera(path: Path, found: HandEye) -> None:
    """Write `found` into the file beside the other cameras, in place of an earlier entry of this one.

    Raises UsageError where the file cannot be written, RecordingError where the existing one is invalid.
    """
    cameras = known_cameras(path)
    cameras[found.serial] = found
    table = {"schema": SCHEMA, "cameras": {serial: _entry(each) for serial, each in sorted(cameras.items())}}
    try:
        with replacement(path) as new:
            new.write_text(tomli_w.dumps(table), encoding="utf-8")
    except OSError as error:
        raise UsageError(f"Cannot write the calibration to {path}: {error.strerror}; choose another place.") from None


def note_check(path: Path, serial: str, *, place: LastCheck | None = None, optics: LastCheck | None = None) -> bool:
    """Write the result of a check into the camera's entry; returns False where the file has no such entry.

    Raises as `save_camera`.
    """
    found = known_cameras(path).get(serial)
    if found is not None:
        save_camera(path, replace(found, place=place or found.place, optics=optics or found.optics))
    return found is not None


def known_cameras(path: Path) -> dict[str, HandEye]:
    """As `load_cameras`; empty where there is no file yet."""
    return load_cameras(path) if path.exists() else {}


def load_cameras(path: Path) -> dict[str, HandEye]:
    """Every camera in the file by its serial number.

    Raises UsageError where the file is missing, and RecordingError, which names the error and its place, where it is
    invalid.
    """
    try:
        table = read_toml(path)
    except OSError as error:
        raise UsageError(
            f"Cannot read the calibration {path}: {error.strerror}; `dipac calibration solve` makes one "
            "(docs/calibration-cameras.md)."
        ) from None
    except ValueError as error:
        raise RecordingError(f"{path} is no TOML file: {error}.") from None
    if table.get("schema") != SCHEMA or table["schema"] is True:
        raise RecordingError(
            f"{path} has calibration schema {table.get('schema')}; this version reads schema {SCHEMA}. Calibrate again "
            "with `dipac calibration solve` or in the console."
        )
    cameras = table.get("cameras", {})
    try:
        refuse_unknown("", table, ("schema", "cameras"))
    except ValueError as error:
        raise RecordingError(f"{path}: {error}.") from None
    if not isinstance(cameras, dict):
        raise RecordingError(f"{path}: 'cameras' must be a table of cameras by their serial numbers.")
    return {serial: _camera(path, serial, entry) for serial, entry in cameras.items()}


def load_lens(path: Path) -> tuple[str, Lens]:
    """A camera's serial number and factory intrinsics, from a file with `serial` and a table `intrinsics`.

    Raises UsageError where the file is missing, and RecordingError, which names the error, where it is invalid.
    """
    try:
        table = read_toml(path)
        refuse_unknown("", table, ("serial", "intrinsics"))
        return str(table["serial"]), _lens(table["intrinsics"])
    except OSError as error:
        raise UsageError(
            f"Cannot read the camera {path}: {error.strerror}; docs/calibration-cameras.md has one to copy."
        ) from None
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        why = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise RecordingError(
            f"{path} is no camera ({why}); it needs serial, and width, height, fx, fy, cx, cy and distortion (five "
            "numbers) in a table [intrinsics]."
        ) from None


def _entry(found: HandEye) -> dict[str, Any]:
    lens, board = found.lens, found.board
    return {
        "setup": found.setup,
        "calibrated_at": found.calibrated_at,
        "pose": _pose(found.pose),
        "board_pose": _pose(found.board_pose),
        "intrinsics": {
            "width": lens.width,
            "height": lens.height,
            "fx": float(lens.K[0, 0]),
            "fy": float(lens.K[1, 1]),
            "cx": float(lens.K[0, 2]),
            "cy": float(lens.K[1, 2]),
            "distortion": list(lens.distortion),
        },
        "board": dict(vars(board)),
        "quality": {
            "views": found.views,
            "outliers": found.outliers,
            "error_px": found.error_px,
            "error_m": found.error_m,
            "error_deg": found.error_deg,
            "deviation_m": list(found.deviation_m),
            "deviation_deg": list(found.deviation_deg),
            "turns_deg": list(found.spread.turns_deg),
            "shifts_m": list(found.spread.shifts_m),
        },
        "checks": {name: dict(vars(each)) for name, each in _checks(found).items()},
    }


def _checks(found: HandEye) -> dict[str, LastCheck]:
    """The checks that have been made, by name."""
    return {name: each for name, each in (("place", found.place), ("optics", found.optics)) if each is not None}


def _pose(T: Transform) -> dict[str, list[float]]:
    turn = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True)
    return {"translation_m": T[:3, 3].tolist(), "quaternion_wxyz": turn.tolist()}


def _camera(path: Path, serial: str, entry: Mapping[str, Any]) -> HandEye:
    try:
        return _read(serial, entry)
    except KeyError as error:
        raise RecordingError(f"{path}: camera {serial!r} lacks {error}; calibrate it again.") from None
    except (TypeError, ValueError, ArithmeticError, AttributeError, DipacError) as error:
        raise RecordingError(f"{path}: camera {serial!r}: {error} Correct it, or calibrate again.") from None


def _read(serial: str, entry: Mapping[str, Any]) -> HandEye:
    """The calibration in a table. Raises KeyError, which names the key, TypeError, ValueError and DipacError."""
    if entry["setup"] not in _SETUPS:
        raise UsageError.unknown("setup", str(entry["setup"]), _SETUPS)
    if type(entry["calibrated_at"]) is not date:
        raise ValueError(f"calibrated_at = {entry['calibrated_at']!r} is no day such as 2026-11-23.")
    quality, board = entry["quality"], entry["board"]
    return HandEye(
        serial=serial,
        setup=_SETUPS[entry["setup"]],
        pose=_transform("pose", entry["pose"]),
        board_pose=_transform("board_pose", entry["board_pose"]),
        lens=_lens(entry["intrinsics"]),
        board=Charuco(
            columns=int(board["columns"]),
            rows=int(board["rows"]),
            square_m=float(board["square_m"]),
            marker_m=float(board["marker_m"]),
            dictionary=str(board["dictionary"]),
        ),
        calibrated_at=entry["calibrated_at"],
        views=int(quality["views"]),
        outliers=int(quality["outliers"]),
        error_px=_number("error_px", quality["error_px"]),
        error_m=_number("error_m", quality["error_m"]),
        error_deg=_number("error_deg", quality["error_deg"]),
        deviation_m=_three("deviation_m", quality["deviation_m"]),
        deviation_deg=_three("deviation_deg", quality["deviation_deg"]),
        spread=Spread(
            turns_deg=_three("turns_deg", quality["turns_deg"]), shifts_m=_three("shifts_m", quality["shifts_m"])
        ),
        place=_check("place", entry),
        optics=_check("optics", entry),
    )


def _check(name: str, entry: Mapping[str, Any]) -> LastCheck | None:
    """The check called `name`; None where there was none, and in older files."""
    if (said := entry.get("checks", {}).get(name)) is None:
        return None
    if type(said["day"]) is not date:
        raise ValueError(f"checks.{name}.day = {said['day']!r} is no day such as 2026-11-23.")
    if said["verdict"] not in _AGREEMENTS:
        raise UsageError.unknown("verdict", str(said["verdict"]), _AGREEMENTS)
    return LastCheck(day=said["day"], verdict=_AGREEMENTS[said["verdict"]], said=str(said["said"]))


def _transform(name: str, entry: Mapping[str, Any]) -> Transform:
    turn = _numbers(f"{name}.quaternion_wxyz", entry["quaternion_wxyz"], 4)
    length = math.hypot(*turn)
    if abs(length - 1.0) > _UNIT:
        raise ValueError(f"{name}.quaternion_wxyz has length {length:.4g} and not 1.")
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(turn, scalar_first=True).as_matrix()
    T[:3, 3] = _numbers(f"{name}.translation_m", entry["translation_m"], 3)
    return T


def _lens(entry: Mapping[str, Any]) -> Lens:
    refuse_unknown("intrinsics.", entry, _INTRINSICS)
    fx, fy, cx, cy = (_number(name, entry[name]) for name in ("fx", "fy", "cx", "cy"))
    width, height = int(entry["width"]), int(entry["height"])
    if not (0 < width <= _LARGEST_PX and 0 < height <= _LARGEST_PX):
        raise ValueError(f"An image of {width} x {height} pixels is none.")
    if not (fx > 0 and fy > 0 and 0 <= cx <= width and 0 <= cy <= height):
        raise ValueError(
            f"fx, fy, cx, cy = {fx:g}, {fy:g}, {cx:g}, {cy:g} are no intrinsics of {width} x {height} pixels."
        )
    k1, k2, p1, p2, k3 = _distortion(entry["distortion"])
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Lens(width=width, height=height, K=K, distortion=(k1, k2, p1, p2, k3))


def _distortion(values: Any) -> tuple[float, ...]:
    """OpenCV's five numbers k1, k2, p1, p2, k3; four lack the last, and five of a longer list may be all that count."""
    if not isinstance(values, list) or len(values) not in (4, 5, 8, 12, 14):
        raise ValueError("distortion must be 5 numbers, k1, k2, p1, p2, k3")
    numbers = (*_numbers("distortion", values, len(values)), 0.0)
    if any(numbers[5:]):
        raise ValueError(
            f"distortion has {len(values)} numbers, a rational model, which is not read; rectify the images first, or "
            "calibrate the lens with five (k1, k2, p1, p2, k3)"
        )
    return numbers[:5]


def _three(name: str, values: Any) -> Three:
    x, y, z = _numbers(name, values, 3)
    return x, y, z


def _numbers(name: str, values: Any, count: int) -> tuple[float, ...]:
    if not isinstance(values, list) or len(values) != count:
        raise ValueError(f"{name} must be {count} numbers.")
    return tuple(_number(name, value) for value in values)


def _number(name: str, value: Any) -> float:
    return finite_number(name, value)
