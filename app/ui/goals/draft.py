"""A goal while it is being drawn. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias, final

import numpy as np

from app.core import goal_shapes
from app.core.types import Points

Kind: TypeAlias = Literal["none", "copy", "curve", "region"]
KINDS: Final[Mapping[str, Kind]] = {
    "Nothing": "none",
    "A moved copy of the object": "copy",
    "A curve that it follows": "curve",
    "A region that it fills": "region",
}
"""Kinds of drawn goals, by their labels."""
LEAST_RADIUS_M: Final = 0.02
_MOST_POINTS, _FARTHEST_M = 200, 3.0
"""Limits of a curve: no hand draws more points, and no table is larger."""
_APART_M = 0.005
"""Distance below which two points of a curve are one."""


@final
@dataclass(frozen=True, kw_only=True)
class GoalDraft:
    """A drawn goal: a copy with its middle at `place` [m], turned and bent; a curve; or a disc about `place`."""

    kind: Kind = "none"
    place: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0
    bend_1_m: float = 0.0
    radius_m: float = 0.08
    curve: tuple[tuple[float, float], ...] = ()

    def with_point(self, x_m: float, y_m: float) -> "GoalDraft":
        """With another point of the curve, unless it repeats the last one, is far away, or exceeds their number."""
        if len(self.curve) >= _MOST_POINTS or not (abs(x_m) < _FARTHEST_M and abs(y_m) < _FARTHEST_M):
            return self
        if self.curve and np.hypot(x_m - self.curve[-1][0], y_m - self.curve[-1][1]) < _APART_M:
            return self
        return replace(self, curve=(*self.curve, (x_m, y_m)))

    def positions(self, object_: Points) -> Points | None:
        """The goal for `object_` (N, 3) [m]; None while nothing is drawn."""
        match self.kind:
            case "none":
                return None
            case "copy":
                to = np.array(self.place)
                return goal_shapes.transform(object_, to=to, turn_rad=self.turn_rad, bend_1_m=self.bend_1_m)
            case "curve":
                return goal_shapes.along(object_, np.array(self.curve)) if len(self.curve) > 1 else None
            case "region":
                return goal_shapes.gather(object_, middle=np.array(self.place), radius_m=self.radius_m)


def on_table(origin: tuple[float, float, float], direction: tuple[float, float, float]) -> tuple[float, float] | None:
    """Intersection of a ray from the eye with the table z = 0 [m]; None where there is none."""
    if direction[2] >= 0 or origin[2] <= 0:
        return None
    far = -origin[2] / direction[2]
    return origin[0] + far * direction[0], origin[1] + far * direction[1]
