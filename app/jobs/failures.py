"""Dumps of simulations that failed for a task, which `dipac replay` shows."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32

from app.calibration.evidence import gather
from app.config import Site
from app.core.errors import UsageError
from app.core.messages import Transition
from app.jobs.jit_cache import needs, now, rod_now
from app.planner.search.failure import failed_action
from app.planner.search.request import PlanRequest
from app.planner.search.tree import TreeConfig
from app.sim.diagnosis.dump import Dump, leave_dump
from app.sim.diagnosis.failure_diagnosis import MpmCase, single
from app.sim.diagnosis.object_state import ObjectState
from app.sim.diagnosis.rod_failure_diagnosis import RodCase, single_rod
from app.sim.model.catalogue import EFFECTS
from app.sim.rods.checks import RodSetup
from app.sim.rods.from_parameters import rod_columns, rod_physics
from app.sim.rods.state import RodState
from app.sim.runtime.checks import Arrays, Setup
from app.tasks import load
from app.tasks.elements.base import Task

DUMPS = 3
"""Largest number of dumps by one process, about 50 kB each: later failures are alike."""

FOLDER = "failed"
"""Folder of dumps, in that of the recordings."""


def of_plan(task: str, search: TreeConfig, request: PlanRequest) -> str:
    """A sentence about the first branch that became non-finite, with the dump it left; empty where none did."""
    failed = failed_action(search, request)
    if failed is None:
        return ""
    about = f"{task}, seed {request.seed}, branch {failed.branch}, action {failed.depth}"
    return _dump_and_report(task, about, request.phi, failed.state, failed.tool, request.site)


def of_transitions(task: str, lost: Sequence[Transition], phi: Float32[np.ndarray, " P"], site: Site) -> str:
    """A sentence about the first of the transitions that `phi` does not predict, with its dump; empty for none."""
    if not lost:
        return ""
    first = gather(lost[:1], load(task).actions.measured_path)
    data = load(task)
    why = "are not predicted" if data.dynamics == "rods" else "left their grid"
    about = f"{task}, transition {lost[0].id}, one of {len(lost)} that {why}"
    return _dump_and_report(task, about, phi, data.initial_state(jnp.asarray(first.before)), first.tool, site)


def _dump_and_report(
    task: str, about: str, phi: Float32[np.ndarray, " P"], state: ObjectState, tool: Arrays, site: Site
) -> str:
    case = _case(load(task), phi, state, tool)
    if next(_room(), None) is None:
        return f" This process has left {DUMPS} dumps already, and leaves no more."
    try:
        path = leave_dump(site.recordings / FOLDER, Dump(case=case, about=about))
    except UsageError as error:
        return f" {error}"
    return f" `dipac replay {path}` shows what broke."


def _case(task: Task, phi: Float32[np.ndarray, " P"], state: ObjectState, tool: Arrays) -> MpmCase | RodCase:
    """One candidate's simulation by whichever engine simulates the task."""
    if not isinstance(state, RodState):
        setup = Setup(scene=task.scene, counts=task.scene.split(state.x.shape[1]), effects=EFFECTS)
        return single(setup, phi[None], state, tool, now(1, state.x.shape[1]))
    assert task.rods is not None
    effects, stiff = needs(task.name, phi)
    own, physics = (
        phi[rod_columns(effects)][None],
        rod_physics(task.rods.scene, task.rods.physics, jnp.asarray(phi)[None]),
    )
    scene = task.rods.scene_for(stiff=stiff)
    return single_rod(RodSetup(scene=scene, effects=effects), physics, state, tool, own, rod_now(task.rods, 1))


@lru_cache
def _room() -> Iterator[int]:
    """The numbers of the dumps that may still be written."""
    return iter(range(DUMPS))
