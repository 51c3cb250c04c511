"""The simulated cell: another physics than the planner's, cameras that are rendered, an arm that is computed."""

from contextlib import AbstractAsyncContextManager
from typing import Final

from app.cells.base import Cell, Wanted, as_it_is
from app.core.ports import Rig
from app.rig.simulated.rig import simulated_rig


def _opened(wanted: Wanted) -> AbstractAsyncContextManager[Rig]:
    task, seed = wanted.task, wanted.seed
    return simulated_rig(stage=task.stage, start=task.start(seed), site=wanted.site, seed=seed)


CELL: Final = Cell(name="simulated", simulated=True, open=_opened, narrowed=as_it_is)
