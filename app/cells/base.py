"""Interface of a cell to the commands: its site limits, and how it is opened."""

from collections.abc import Callable, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.scene_description import Stage
from app.core.geometry.shapes.tools import Tool
from app.core.geometry.table_place import TablePlace
from app.core.messages import ArmState
from app.core.ports import Arm, Camera, Posed, Rig
from app.recording.exchange.calibration_file import CalibrationFile


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Wanted:
    """Options with which a cell is opened. `board`: the gripper holds one, to calibrate cameras by.

    `file` describes a real cell, and is the recording that a replayed one shows. In a simulated one the stage's object
    starts at `start (K, 3)` [m], and `seed` is that of the cameras' noise.
    """

    stage: Stage
    start: Float64[np.ndarray, "K 3"]
    site: Site
    seed: int
    board: bool = False
    file: Path | None = None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class OpenedRig:
    """A cell that is open, as the `Rig` of its parts."""

    name: str
    simulated: bool
    shape: ArmShape | None
    seen_arm: Posed
    cameras: Sequence[Camera]
    arm: Arm


Open: TypeAlias = Callable[[Wanted], AbstractAsyncContextManager[Rig]]


def _beside_the_program(_: Path | None) -> CalibrationFile:
    """Calibration file in the working directory."""
    return CalibrationFile()


@final
@dataclass(frozen=True, kw_only=True)
class Cell:
    """A cell by its name. `simulated`: nothing real can move; `narrowed`: the site with the limits of its file, if any.

    `answers`: True where the images respond to the arm's motions; without that there is nothing to learn from them.
    `shelf`: store of its cameras' calibrations, by its file. `pictured`: geometry of the arm in images recorded there,
    from this tool, any of its recorded states and the table's pose; None where unknown.
    """

    name: str
    simulated: bool
    open: Open
    narrowed: Callable[[Site, Path | None], Site]
    answers: bool = True
    shelf: Callable[[Path | None], CalibrationFile] = _beside_the_program
    pictured: Callable[[Tool, ArmState, TablePlace], ArmShape] | None = None


def as_it_is(site: Site, file: Path | None) -> Site:
    """The site of a cell that needs no file. Raises UsageError where one is given."""
    if file is not None:
        raise UsageError(
            f"--cell {file} is for a real cell (--rig gen3, or rehearsal to rehearse it) or a recorded one (--rig "
            "replayed); choose one of them as well, or leave it out."
        )
    return site
