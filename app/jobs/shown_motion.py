"""Simulation of a motion that was demonstrated, for the object where it is now."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.core.errors import PlanningError

if TYPE_CHECKING:
    from app.core.messages import Model
    from app.core.types import Points, ToolPath


def predict_motion(task: str, observed: Points, model: Model, tool: ToolPath) -> Points:
    """The object, seen at `observed` (N, 3) [m], after the motion of the `tool` along poses (T, 8), as cameras show it.

    What the model says of cameras is allowed for. Raises PlanningError where the simulation becomes non-finite, or the
    motion is none of the task's.
    """
    import jax.numpy as jnp

    from app.jobs import jit_cache
    from app.jobs.worker_api import correction_of
    from app.tasks import load

    allowed_for = correction_of(model)
    x = allowed_for.unproject(observed) if allowed_for else observed
    try:
        path = load(task).actions.measured_path(tool)
    except ValueError as error:
        raise PlanningError(str(error)) from None
    phi = jit_cache.phi_of(model)
    simulate = jit_cache.advance(task, len(x), *jit_cache.needs(task, phi))
    predicted = np.asarray(simulate(*map(jnp.asarray, (phi[None], x[None], path[None])))[0])
    if not np.isfinite(predicted).all():
        raise PlanningError("Its simulation became non-finite, so that nobody knows what it would do.")
    return allowed_for.observe(predicted) if allowed_for else predicted
