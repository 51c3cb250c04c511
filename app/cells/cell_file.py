"""A real cell as a TOML file: its arm, its cameras, and its limits (docs/real-cell.md)."""

import difflib
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from ipaddress import ip_address
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, TypeAlias, final

import msgspec
import numpy as np

from app.config import KeepOut, Limits, Reach, Site, Workspace
from app.core.errors import RecordingError, UsageError
from app.core.geometry.table_place import TablePlace
from app.core.motion import pointing_down
from app.recording.exchange.toml_file import read_toml
from app.rig.kinova.client.clients import CLIENTS
from app.rig.kinova.gen3 import reach_over

SCHEMA: Final = 1
_BELOW_M: Final = 0.02
"""Depth below the table at which a workspace may begin: a table is never known better than to some millimetres."""
_MOST: Final = Limits()
Point: TypeAlias = tuple[float, float, float]
"""x y z [m] in the frame of the table."""


class _Entry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file. A misspelt key is an error: it might have been a limit."""


class BoxEntry(_Entry, frozen=True):
    """A box between two corners [m]."""

    low: Point
    high: Point


class Volume(BoxEntry, frozen=True):
    """A box that the tool's tip may not enter [m]."""

    name: str


class TableEntry(_Entry, frozen=True):
    """The table's frame: its origin in that of the arm's base [m], and its rotation about the vertical.

    Its surface is z = 0 of its own frame, in which all other positions of the file are.
    """

    place_m: Point = (0.0, 0.0, 0.0)
    turn_deg: Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)] = 0.0


class Within(_Entry, frozen=True):
    """Limits of the arm in this cell: those of `Limits` at most."""

    workspace: BoxEntry
    keep_out: tuple[Volume, ...] = ()
    speed_m_s: Annotated[float, msgspec.Meta(gt=0, le=_MOST.speed_m_s)] = 0.10
    acceleration_m_s2: Annotated[float, msgspec.Meta(gt=0, le=_MOST.acceleration_m_s2)] = 0.5
    angular_speed_rad_s: Annotated[float, msgspec.Meta(gt=0, le=_MOST.angular_speed_rad_s)] = 0.5
    force_n: Annotated[float, msgspec.Meta(gt=0, le=_MOST.force_n)] = 30.0
    gripper_ma: Annotated[float, msgspec.Meta(gt=0, le=2550.0)] | None = None


class ToolEntry(_Entry, frozen=True):
    """Pose of the tool's tip: its distance from the arm's flange along its axis, and its frame's rotation about that.

    A closed Robotiq 2F-85 ends at 0.163 m, and opens along the flange's x axis, which becomes the tool's y axis.
    `mass_kg`: total beyond the flange; not checked where it is not given.
    """

    tip_m: Annotated[float, msgspec.Meta(ge=0.0, le=0.6)] = 0.163
    turn_deg: Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)] = 90.0
    mass_kg: Annotated[float, msgspec.Meta(ge=0.0, le=4.0)] | None = None


class ArmEntry(_Entry, frozen=True):
    """Network address of the arm's controller, and its tool. `client`: `dipac` or `kortex_api`."""

    host: str = "192.168.1.10"
    client: str = "dipac"
    tool: ToolEntry = ToolEntry()


class CameraEntry(_Entry, frozen=True):
    """A RealSense camera by its serial number; its images have the size that it was calibrated with."""

    name: str
    serial: str


@final
class CellFile(_Entry, frozen=True):
    """The whole file. `calibration` is a path relative to the file's own folder."""

    schema: int
    name: str
    limits: Within
    cameras: tuple[CameraEntry, ...]
    arm: ArmEntry = ArmEntry()
    table: TableEntry = TableEntry()
    travel_height_m: float = 0.15
    calibration: str = "calibration.toml"


_PLACES: Final[Mapping[str, type[_Entry]]] = MappingProxyType(
    {
        "to the beginning of the file, before all tables": CellFile,
        "into [limits]": Within,
        "into [[cameras]]": CameraEntry,
        "into [arm]": ArmEntry,
        "into [arm.tool]": ToolEntry,
        "into [table]": TableEntry,
        "into [[limits.keep_out]]": Volume,
    }
)
"""Tables of the file, by where they stand in it."""


def load_cell(path: Path) -> CellFile:
    """Read and check a cell file.

    Raises UsageError where it is missing, and RecordingError, which names the error, where it is invalid.
    """
    try:
        cell = msgspec.convert(read_toml(path), CellFile)
    except OSError as error:
        raise UsageError(f"Cannot read the cell {path}: {error.strerror}; docs/real-cell.md has one to copy.") from None
    except ValueError as error:
        raise RecordingError(
            f"{path} describes no cell: {error}.{_meant(str(error))} docs/real-cell.md says what it has to hold."
        ) from None
    if wrong := _wrong(cell):
        raise RecordingError(f"{path} describes no cell: {wrong}.")
    return cell


def table(cell: CellFile) -> TablePlace:
    """Pose of its table."""
    return TablePlace(place_m=cell.table.place_m, turn_deg=cell.table.turn_deg)


def narrowed_by(cell: CellFile, site: Site) -> Site:
    """The site with the limits of the file; the slower of the two speeds counts."""
    own = limits(cell)
    own = replace(own, speed_m_s=min(own.speed_m_s, site.limits.speed_m_s))
    return replace(site, limits=own, table=table(cell), travel_height_m=cell.travel_height_m)


def limits(cell: CellFile) -> Limits:
    """Limits of its arm."""
    said = cell.limits
    return Limits(
        speed_m_s=said.speed_m_s,
        acceleration_m_s2=said.acceleration_m_s2,
        angular_speed_rad_s=said.angular_speed_rad_s,
        force_n=said.force_n,
        gripper_ma=said.gripper_ma,
        reach=_reach(cell),
        workspace=Workspace(low=said.workspace.low, high=said.workspace.high),
        keep_out=tuple(KeepOut(name=each.name, low=each.low, high=each.high) for each in said.keep_out),
    )


def far_corner(cell: CellFile) -> str:
    """Sentence on the part of the workspace out of reach for a tool that points down; empty where there is none."""
    beyond_m = _beyond_m(cell, middle=False)
    if beyond_m <= 0:
        return ""
    return (
        f"The farthest corner of the workspace of {cell.name!r} is {1e3 * beyond_m:.0f} mm further away than the arm "
        "reaches with a tool that points down; motions there are refused, and none is planned."
    )


def _beyond_m(cell: CellFile, *, middle: bool) -> float:
    """Largest distance of the workspace out of reach; where `middle`, of the pose over its middle."""
    low, high = np.array(cell.limits.workspace.low), np.array(cell.limits.workspace.high)
    corners = np.stack(np.meshgrid(*np.stack([low, high]).T), axis=-1).reshape(-1, 3)
    over = np.array([[*(low + high)[:2] / 2, cell.travel_height_m]])
    poses = np.array([pointing_down(each) for each in (over if middle else corners)])
    return float(_reach(cell).beyond_m(poses).max())


def _reach(cell: CellFile) -> Reach:
    """Reach of its arm, in the table's frame."""
    return reach_over(table(cell), cell.arm.tool.tip_m)


def _meant(error: str) -> str:
    """Sentence that suggests a key similar to the unknown one that `error` names; empty where none is."""
    unknown = re.search(r"unknown field `(.+?)`", error)
    if unknown is None:
        return ""
    for place, entry in _PLACES.items():
        if unknown[1] in entry.__struct_fields__:
            return f" It belongs {place}."
    known = {name for entry in _PLACES.values() for name in entry.__struct_fields__}
    near = difflib.get_close_matches(unknown[1], sorted(known), n=1)
    return f" Did you mean {near[0]!r}?" if near else ""


def _wrong_host(host: str) -> str:
    """Error in the address of the arm's controller; empty for a valid one."""
    with suppress(ValueError):
        ip_address(host)
        return ""
    if re.fullmatch(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?", host):
        return ""
    return f"the arm's host is {host!r}; give its address alone, such as 192.168.1.10, without http:// and port"


def _wrong(cell: CellFile) -> str:
    """Error beyond the checks of the types; empty for a valid file."""
    if cell.schema != SCHEMA:
        return f"it has schema {cell.schema}, and this version reads {SCHEMA}"
    if cell.arm.client not in CLIENTS:
        return f"the arm's client is {cell.arm.client!r}, and there are {', '.join(sorted(CLIENTS))}"
    if wrong := _wrong_host(cell.arm.host):
        return wrong
    if not all(map(math.isfinite, cell.table.place_m)):
        return f"the table's place_m {cell.table.place_m} is not finite"
    boxes = [("workspace", cell.limits.workspace), *((each.name, each) for each in cell.limits.keep_out)]
    for name, box in boxes:
        if not all(-math.inf < low < high < math.inf for low, high in zip(box.low, box.high, strict=True)):
            return f"of {name!r} each number of low must be below that of high, and all finite"
    whole = cell.limits.workspace
    for each in cell.limits.keep_out:
        if all(a <= b for a, b in zip(each.low, whole.low, strict=True)) and all(
            a >= b for a, b in zip(each.high, whole.high, strict=True)
        ):
            return f"the keep-out {each.name!r} fills all of the workspace, so that no motion is left"
    low, high = cell.limits.workspace.low[2], cell.limits.workspace.high[2]
    if low < -_BELOW_M:
        return f"the workspace begins {-1e3 * low:.0f} mm below the table, whose top is z = 0; the tool would hit it"
    if not low < cell.travel_height_m < high:
        return f"travel_height_m {cell.travel_height_m} is not within the workspace's height {low} to {high} m"
    if (beyond_m := _beyond_m(cell, middle=True)) > 0:
        return (
            f"over the middle of its workspace, at travel_height_m, a tool that points down is {1e3 * beyond_m:.0f} mm "
            "further away than the arm reaches; put the workspace nearer to its base"
        )
    if len(cell.cameras) < 2:
        return f"it has {len(cell.cameras)} cameras, and one alone does not see around an object"
    for camera in cell.cameras:
        if not camera.name.isprintable() or camera.name != camera.name.strip(" ./") or "/" in camera.name:
            return f"a camera is called {camera.name!r}; give a plain word such as left"
        if not camera.name or not camera.serial.strip():
            return "a camera has an empty name or serial; `rs-enumerate-devices -s` lists serial numbers"
    for what in ("name", "serial"):
        values = [getattr(camera, what) for camera in cell.cameras]
        if len(set(values)) < len(values):
            return f"two cameras have the same {what}"
    return ""
