"""The simulated cell: another physics than the planner's, cameras that are rendered, an arm that is computed."""

from contextlib import AbstractAsyncContextManager
from typing import Final

from app.cells.base import Cell, Wanted, as_it_is
from app.core.ports import Rig
from app.rig.simulated.held_board import HeldBoard
from app.rig.simulated.rig import simulated_rig


def _opened(wanted: Wanted) -> AbstractAsyncContextManager[Rig]:
    held = HeldBoard() if wanted.board else None
    return simulated_rig(stage=wanted.stage, start=wanted.start, site=wanted.site, seed=wanted.seed, held=held)


CELL: Final = Cell(name="simulated", simulated=True, open=_opened, narrowed=as_it_is)
