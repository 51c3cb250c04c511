"""A real cell: a Kinova Gen3, RealSense cameras around it, and a file with their poses and limits."""

import os
import sys
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

from anyio import to_thread

from app.cells.base import Cell, OpenedRig, Wanted
from app.cells.cell_file import CameraEntry, CellFile, ToolEntry, far_corner, load_cell, narrowed_by, table
from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.hand_eye import HandEye
from app.core.geometry.shapes.tools import Tool
from app.core.geometry.table_place import TablePlace
from app.core.messages import ArmState
from app.recording.exchange.calibration_file import CalibrationFile, known_cameras
from app.rig.kinova.arm import kinova_arm
from app.rig.kinova.arm_configuration_check import Holds
from app.rig.kinova.client.link import Address
from app.rig.kinova.shape import known_gen3, tip_m
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.cameras import realsense_cameras
from app.rig.realsense.sdk.sources import Live
from app.rig.realsense.settings import StreamSettings

USER, PASSWORD = "DIPAC_ARM_USER", "DIPAC_ARM_PASSWORD"
"""Environment variables with the arm's account, where it is not the factory default."""
_NEEDED = "--rig gen3 needs --cell FILE.toml, which says where arm and cameras are; docs/real-cell.md has one to copy."


def _narrow_site(site: Site, file: Path | None) -> Site:
    """The site with the limits and the table of the file."""
    cell, _ = _read(file)
    return narrowed_by(cell, site)


@asynccontextmanager
async def _open_cell(wanted: Wanted) -> AsyncGenerator[OpenedRig]:
    """Open the cell. Raises DeviceError where arm or cameras are missing; cameras may be uncalibrated."""
    cell, mounted = await to_thread.run_sync(_cell_and_cameras, wanted.file)
    if far := far_corner(cell):
        sys.stderr.write(f"dipac: {far}\n")
    async with (
        kinova_arm(address(cell), wanted.site, cell.arm.client, holds(cell.arm.tool)) as arm,
        realsense_cameras(mounted, wanted.site.timing) as cameras,
    ):
        gen3 = known_gen3(wanted.stage.tool, cell.arm.tool.tip_m)
        shape = replace(gen3, T_world_base=wanted.site.table.table_from_base)
        yield OpenedRig(name=cell.name, simulated=False, shape=shape, seen_arm=arm, cameras=cameras, arm=arm)


def _cell_and_cameras(file: Path | None) -> tuple[CellFile, list[Mounted]]:
    """The file's content, and its cameras, with their poses as far as they are calibrated."""
    cell, there = _read(file)
    calibration = calibration_of(cell, there)
    places = {serial: table(cell).camera_in_table(found) for serial, found in known_cameras(calibration).items()}
    return cell, [_camera_mount(camera, places, calibration) for camera in cell.cameras]


def calibration_of(cell: CellFile, file: Path) -> Path:
    """Path of the cameras' calibration file."""
    own = Path(cell.calibration)
    with suppress(RuntimeError):  # Without a home, ~ is a folder like any other.
        own = own.expanduser()
    return file.parent / own


def _shelf(file: Path | None) -> CalibrationFile:
    cell, there = _read(file)
    serials = {camera.name: camera.serial for camera in cell.cameras}
    return CalibrationFile(calibration_of(cell, there), serials, table(cell))


def _read(file: Path | None) -> tuple[CellFile, Path]:
    if file is None:
        raise UsageError(_NEEDED)
    return load_cell(file), file


def address(cell: CellFile) -> Address:
    """Address of the arm, with the account from the environment."""
    usual = Address(host=cell.arm.host)
    user, password = os.environ.get(USER, usual.username), os.environ.get(PASSWORD, usual.password)
    return replace(usual, username=user, password=password)


def holds(tool: ToolEntry) -> Holds:
    """End effector that the arm must be configured for."""
    return Holds(tip_m=tool.tip_m, turn_deg=tool.turn_deg, mass_kg=tool.mass_kg)


def _camera_mount(camera: CameraEntry, places: dict[str, HandEye], file: Path) -> Mounted:
    """The camera with its calibrated pose; at the arm's base, undated, where it has none yet."""
    if camera.serial not in places:
        sys.stderr.write(
            f"dipac: {file} does not say where camera {camera.name!r} ({camera.serial}) stands. Nothing is approved "
            "before it is calibrated: in the tab Calibrate of the console, or with "
            f"`dipac calibration solve FOLDER -o {file}`.\n"
        )
        return Mounted(name=camera.name, source=Live(serial=camera.serial))
    return Mounted.from_calibration(places[camera.serial], name=camera.name, settings=StreamSettings())


def _arm_shape(tool: Tool, state: ArmState, table: TablePlace) -> ArmShape:
    tip = table.base_from_table[:3, :3] @ state.pose[:3] + table.place_m
    return replace(known_gen3(tool, tip_m(state.joints, tip)), T_world_base=table.table_from_base)


CELL: Final = Cell(
    name="gen3", simulated=False, open=_open_cell, narrowed=_narrow_site, shelf=_shelf, pictured=_arm_shape
)
