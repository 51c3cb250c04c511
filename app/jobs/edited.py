"""A motion of a plan that an operator has changed by its ends, as a plan: simulated and costed as its branches were."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.path_similarity_transform import reshape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxtyping import Float64

    from app.core.messages import Branch, Model
    from app.core.types import Centreline, Points
    from app.planner.search.plan import Plan

    End: TypeAlias = Float64[np.ndarray, "3"]


def edited_plan(
    task: str,
    preset: str,
    observed: Points,
    goal: Points,
    model: Model,
    branches: Sequence[Branch],
    index: int,
    start: End,
    end: End,
    site: Site | None = None,
    near: Centreline | None = None,
    orientation: Orientation = UNKNOWN,
) -> Plan:
    """The first motion of branch `index`, but from `start` to `end` (3,) [m], for the object as cameras see it (N, 3).

    Its branch comes first and is the one proposed, whatever it costs; behind it are `branches`, to compare it with.
    What the model says of cameras and arm is allowed for, and `near` and `orientation` are used, as in `jobs.plan`.
    Raises PlanningError, with what to change, where the task has no pushes, or this one cannot be made.
    """
    from dataclasses import replace

    from app.jobs import jit_cache, rope_orientation
    from app.jobs.apparatus_compensation import correction
    from app.planner.actions.actions import Pushes
    from app.planner.manual_plan import GivenPush
    from app.planner.search.request import PlanRequest
    from app.tasks import load

    pushes, where = load(task).actions, site or Site()
    if not isinstance(pushes, Pushes):
        raise PlanningError(f"Motions of {task} cannot be edited, only pushes over a table; approve or reject it.")
    if not 0 <= index < len(branches):
        raise PlanningError("That plan has no such branch; edit the one that is shown.")
    way = reshape(branches[index].tool_path.astype(np.float64), start, end)
    search = jit_cache.search(task, preset, jit_cache.phi_of(model), where.limits.confines)
    planner = GivenPush(search=replace(search, branches=1), pushes=pushes, way=way)
    allowed_for = correction(model) if model.apparatus else None
    x = allowed_for.unproject(observed) if allowed_for else observed
    phi = rope_orientation.oriented_phi(model, x, orientation, near)
    request = PlanRequest(observed=observed, goal=goal, phi=phi, site=where, near=near)
    found = allowed_for.plan(planner, request) if allowed_for else planner(request)
    return replace(found, branches=(*found.branches, *branches), best=0)
