"""Success criteria of tasks: conditions on the object's position, for observations and the truth alike."""

from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from scipy.spatial import KDTree

from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.shapes.fixtures import Mat
from app.core.types import Points
from app.policy.marked_bowl import MarkedBowl


class SuccessCriterion(Protocol):
    """Criterion on particles `x` (N, 3) [m], given the goal (M, 3) [m]."""

    def is_reached(self, x: Points, goal: Points) -> bool:
        """True if the task is done."""
        ...

    def share(self, x: Points, goal: Points) -> float:
        """Share of the object that meets the criterion, 0 to 1."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class Near:
    """The object lies like the goal: their Chamfer distance is at most `limit_m2` [m^2]."""

    limit_m2: float

    def is_reached(self, x: Points, goal: Points) -> bool:
        """Within the limit."""
        return bool(chamfer_m2(x, goal) <= self.limit_m2)

    def share(self, x: Points, goal: Points) -> float:
        """Share of the particles as near to the goal as the limit permits if all are."""
        return float(np.mean(KDTree(goal).query(x)[0] ** 2 <= self.limit_m2 / 2))


@final
@dataclass(frozen=True, kw_only=True)
class OnMat:
    """Nearly all of the object lies on a round mat: the share `enough` of it or more, seen from above."""

    mat: Mat
    enough: float

    def is_reached(self, x: Points, goal: Points) -> bool:
        """Enough of it is there, wherever on the mat."""
        return self.share(x, goal) >= self.enough

    def share(self, x: Points, goal: Points) -> float:
        """Share of the particles over the mat."""
        del goal
        return float(np.mean(np.linalg.norm(x[:, :2] - self.mat.place_m, axis=1) <= self.mat.radius_m))


@final
@dataclass(frozen=True, kw_only=True)
class InBowl:
    """At least `least` of the object is in the ball `radius_m` about `place_m`, below its middle: in the bowl there."""

    place_m: tuple[float, float, float]
    radius_m: float
    least: float

    def is_reached(self, x: Points, goal: Points) -> bool:
        """Enough of it."""
        return self.share(x, goal) >= self.least

    def share(self, x: Points, goal: Points) -> float:
        """Share of the particles in the lower half of the ball."""
        del goal
        return MarkedBowl(place_m=self.place_m, radius_m=self.radius_m).share(x)


@final
@dataclass(frozen=True, kw_only=True)
class Hung:
    """A cloth stays on a rack along x: it hangs on both sides of its middle `y_m`.

    Nearly all of it is above `low_m` [m] and within `reach_m` of the rack's middle, and `least_side` of it at least is
    on either side. Whether something else than the rods holds it is for those to say who know the tool.
    """

    y_m: float
    reach_m: float
    low_m: float
    least_side: float = 0.25
    nearly: float = 0.97

    def is_reached(self, x: Points, goal: Points) -> bool:
        """True if it hangs."""
        before = float(np.mean(x[:, 1] < self.y_m))
        return self.share(x, goal) >= self.nearly and self.least_side <= before <= 1 - self.least_side

    def share(self, x: Points, goal: Points) -> float:
        """Share of the particles that are off the table and near the rack."""
        del goal
        return float(np.mean((x[:, 2] > self.low_m) & (np.abs(x[:, 1] - self.y_m) < self.reach_m)))


@final
@dataclass(frozen=True, kw_only=True)
class Beyond:
    """The object has passed x = `x_m` [m]: the share `enough` of it or more, wherever it then lies."""

    x_m: float
    enough: float

    def is_reached(self, x: Points, goal: Points) -> bool:
        """Enough of it is beyond."""
        return self.share(x, goal) >= self.enough

    def share(self, x: Points, goal: Points) -> float:
        """Share of the particles beyond."""
        del goal
        return float(np.mean(x[:, 0] > self.x_m))
