"""Checks of `doctor` on a real cell: its file, its cameras and their calibration, its arm. Nothing moves."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from app.cells.cell_file import CameraEntry, CellFile, far_corner, load_cell
from app.cells.gen3 import address, calibration_of, holds
from app.commands._checks import SETUP, Check, CheckResult, census
from app.core.errors import DipacError
from app.core.geometry.hand_eye import HandEye
from app.recording.exchange.calibration_file import known_cameras
from app.rig.kinova.probe import look_at


def cell_checks(file: Path) -> tuple[Check, ...]:
    """Checks of the cell that `file` describes; of the file alone if it describes none."""
    try:
        cell = load_cell(file)
    except DipacError as error:
        wrong = CheckResult(what="cell", state="missing", found=f"{file} describes none", mend=str(error))
        return (lambda: [wrong],)
    return (
        lambda: _file(cell, file),
        lambda: _cameras(cell),
        lambda: _calibrations(cell, file),
        lambda: _arm(cell),
    )


def _file(cell: CellFile, file: Path) -> list[CheckResult]:
    far = far_corner(cell)
    return [CheckResult(what="cell", state="optional" if far else "ok", found=f"{cell.name!r} of {file}", mend=far)]


def _cameras(cell: CellFile) -> list[CheckResult]:
    """Check that each camera is on the bus."""
    probe = census()
    if probe.failure:
        return [CheckResult(what="cameras of the cell", state="missing", found=probe.failure, mend=SETUP)]
    return [_camera(camera, probe.said["connections"]) for camera in cell.cameras]


def _camera(camera: CameraEntry, there: Mapping[str, str]) -> CheckResult:
    """`there`: the defect of each camera's connection, by the serial numbers of the cameras on the bus."""
    what, serial = f"camera {camera.name}", camera.serial
    if serial not in there:
        mend = "Connect it to a USB 3 port, or correct its serial number in the cell's file."
        return CheckResult(what=what, state="missing", found=f"{serial} is not on the bus", mend=mend)
    wrong = there[serial]
    return CheckResult(what=what, state="optional" if wrong else "ok", found=f"{serial} is on the bus", mend=wrong)


def _calibrations(cell: CellFile, file: Path) -> list[CheckResult]:
    """Check that each camera is calibrated, and since when."""
    path = calibration_of(cell, file)
    try:
        known = known_cameras(path)
    except DipacError as error:
        return [CheckResult(what="calibration", state="missing", found=f"{path} is none", mend=str(error))]
    console = f"in the tab Calibrate of `dipac console TASK --rig gen3 --cell {file}`"
    anew = f"Calibrate it {console}, or with `dipac calibration solve FOLDER -o {path}`."
    return [_check_calibrated(camera.name, known.get(camera.serial), path, console, anew) for camera in cell.cameras]


def _check_calibrated(name: str, found: HandEye | None, path: Path, console: str, anew: str) -> CheckResult:
    """`console`: the place in the console where that is done; `anew`: how a camera is calibrated."""
    what = f"calibration of {name}"
    if found is None:
        return CheckResult(what=what, state="missing", found=f"none in {path}", mend=anew)
    model, today = found.model(depth_unit_m=1.0), datetime.now(UTC).date()
    days = model.age_days(today)
    said = f"of {model.calibrated_at}" + ("" if days is None else f", known to hold {days} days ago")
    if not model.stale(today):
        return CheckResult(what=what, state="ok", found=said)
    doubt = model.doubt or f"It is old; Check, {console}, says whether it still holds."
    return CheckResult(what=what, state="optional", found=said, mend=f"{doubt} {anew}")


def _arm(cell: CellFile) -> list[CheckResult]:
    """Check that the arm is there, configured for its tool, and in no fault."""
    try:
        found = look_at(address(cell), cell.arm.client, holds(cell.arm.tool))
    except DipacError as error:
        return [
            CheckResult(what="arm", state="missing", found=f"not as it should be, at {cell.arm.host}", mend=str(error))
        ]
    return [CheckResult(what="arm", state="ok", found=f"{found}, at {cell.arm.host}")]
