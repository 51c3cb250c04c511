"""Belief about which end of a rope is the first one of a model, tracked from view to view.

A view of a rope does not tell its ends apart, but some parameters of a model do: those that change their sign with the
end that is called the first (`Effect.odd`). Each push whose outcome the two ways round predict differently says which
of them is right, and nodes that are followed from view to view keep what is known.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Final, Self, final

import numpy as np
from jaxtyping import Float32

from app.core.types import Centreline

SURE: Final = 0.95
"""Posterior probability of a way round from which on it is taken for known."""
_LEAST_LOG_ODDS: Final = math.log(SURE / (1 - SURE))
_SCALE_M: Final = 1.5e-3
"""Scale of a prediction's distance from what is seen, root mean square over the nodes, where the simulation is right.

The distance has Cauchy's distribution: simulations err by more than views do, by how much differs from push to push,
and alike at neighbouring nodes, so that a push says as much as one number does. With two degrees of freedom or more
directions what was said of the ends in MuJoCo's worlds was too sure (`python -m bench.hidden.ends`).
"""
_NEARER: Final = 2.0
"""Nodes are followed where one order is so many times nearer to the last ones than the other is."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Orientation:
    """Logarithm of the odds that the nodes `line` [m], as last seen, begin at the model's first end.

    `odd_parameters`: of the model; what is known is not about a model with others.
    """

    line: Centreline = field(default_factory=lambda: np.zeros((2, 0), np.float32))
    log_odds: float = 0.0
    odd_parameters: tuple[float, ...] = ()

    @property
    def probability(self) -> float:
        """Posterior probability of the likelier way round, from 0.5."""
        return 1 / (1 + math.exp(-abs(self.log_odds)))

    @property
    def is_known(self) -> bool:
        """True if one way round is as good as certain."""
        return abs(self.log_odds) >= _LEAST_LOG_ODDS

    def for_odd_parameters(self, values: tuple[float, ...]) -> Self:
        """The same for a model with these odd parameters: unknown if it was about others."""
        return self if values == self.odd_parameters else type(self)(line=self.line, odd_parameters=values)

    def sign(self, line: Centreline) -> float:
        """1 if a rope that is seen along the nodes `line` begins at the model's first end, -1 if it ends there.

        0 if that is unknown.
        """
        return self._relative_direction(line) * math.copysign(1.0, self.log_odds) if self.is_known else 0.0

    def observe(self, before: Centreline, predicted: Float32[np.ndarray, "2 2 n"], after: Centreline) -> Self:
        """The belief after a push that moved the rope from the nodes `before` to `after` [m], in the same order.

        `predicted`: nodes after it, in that order, if `before` begins at the model's first end, and if it ends there.
        A prediction that is not finite says nothing.
        """
        first_m2, last_m2 = ((predicted - after) ** 2).sum(1).mean(1).tolist()
        told = self._relative_direction(before) * self.log_odds
        if math.isfinite(first_m2 + last_m2):
            told += math.log((_SCALE_M**2 + last_m2) / (_SCALE_M**2 + first_m2))
        return replace(self, line=after, log_odds=told)

    def _relative_direction(self, line: Centreline) -> float:
        """1 if `line` runs as the last nodes did, -1 if the other way; 0 if it lies elsewhere or there were none."""
        if line.shape != self.line.shape or not line.size:
            return 0.0
        along, against = (float(np.linalg.norm(each - self.line, axis=0).mean()) for each in (line, line[:, ::-1]))
        if max(along, against) < _NEARER * min(along, against):
            return 0.0
        return 1.0 if along < against else -1.0


UNKNOWN: Final = Orientation()
"""Nothing has been seen yet."""
