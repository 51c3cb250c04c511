"""Feasibility check of a goal, before anything is planned for it."""

import numpy as np

from app.core.errors import UsageError
from app.core.types import Points
from app.tasks.elements.base import Task

_MARGIN_M = 0.002
"""Points this deep inside a fixture are drawn carelessly, and no error."""


def check_goal(task: Task, goal: Points, name: str) -> None:
    """Raises UsageError, which begins with `name`, if a goal (M, 3) [m] is inside a fixture or out of reach."""
    for fixture in task.stage.fixtures:
        deep = fixture.contains(goal, _MARGIN_M)
        if deep.any():
            point = np.round(goal[int(np.argmax(deep))].astype(float), 3).tolist()
            raise UsageError(
                f"{name}: {int(deep.sum())} of {len(goal)} points are inside the {type(fixture).__name__.lower()} of "
                f"{task.name}, the first at {point} m; move the goal off it."
            )
    low, high = (np.asarray(corner) for corner in task.actions.reach)
    middle = goal.mean(axis=0).astype(np.float64)
    if (middle < low).any() or (middle > high).any():
        bounds = ", ".join(f"{axis} {a:g} to {b:g}" for axis, a, b in zip("xyz", low, high, strict=True))
        raise UsageError(
            f"{name}: its middle, {np.round(middle, 3).tolist()} m, is out of reach: {task.name} can bring the object "
            f"to {bounds} m."
        )
