"""The simulated cell: a physics different from the planner's, rendered cameras, and a computed arm."""

from contextlib import AbstractAsyncContextManager
from typing import Final

from app.cells.base import Cell, Wanted, as_it_is
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.shapes.tools import Tool
from app.core.geometry.table_place import TablePlace
from app.core.messages import ArmState
from app.core.ports import Rig
from app.rig.simulated.cameras.held_board import HeldBoard
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.rig import simulated_rig


def _open_cell(wanted: Wanted) -> AbstractAsyncContextManager[Rig]:
    held = HeldBoard() if wanted.board else None
    return simulated_rig(stage=wanted.stage, start=wanted.start, site=wanted.site, seed=wanted.seed, held=held)


def drawn_geometry(tool: Tool, state: ArmState, table: TablePlace) -> ArmShape:
    """Geometry of the drawn arm, whatever its state: at the origin, wherever a commanded one would stand."""
    del state, table
    return known_arm(tool)


CELL: Final = Cell(name="simulated", simulated=True, open=_open_cell, narrowed=as_it_is, pictured=drawn_geometry)
