"""Anderson's acceleration of a fixed-point iteration (Anderson 1965; Walker and Ni 2011, SIAM J. Numer. Anal. 49)."""

from typing import final

import numpy as np
from jaxtyping import Float64

_MEMORY, _SINGULAR = 5, 1e-6
"""Rounds of which the next is extrapolated, and which share of the largest difference between them is none."""


@final
class AndersonExtrapolation:
    """The last rounds of an iteration, from which the place is extrapolated where a round would change nothing."""

    def __init__(self) -> None:
        self._begun, self._reached = list[Float64[np.ndarray, " N"]](), list[Float64[np.ndarray, " N"]]()

    def after(self, begun: Float64[np.ndarray, " N"], reached: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, " N"]:
        """The place from which to go on after a round from `begun` to `reached`; the latter after the first."""
        self._begun, self._reached = [*self._begun, begun][-_MEMORY:], [*self._reached, reached][-_MEMORY:]
        if len(self._reached) == 1:
            return reached
        ends = np.array(self._reached)
        changes = ends - np.array(self._begun)
        shares = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=_SINGULAR)[0]
        return reached - shares @ np.diff(ends, axis=0)
