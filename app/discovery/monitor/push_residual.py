"""Prediction error of a push, and its direction, without simulation."""

import math
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64, Int

from app.core.dialogue.approval import drift
from app.core.geometry.track import Track
from app.core.messages import Executed
from app.core.types import Path3, Points

_SHARE = 0.25
"""Default of a prediction's error as a share of the motion: it only weighs long pushes against short ones."""
_LEAST_M = 5e-4
"""Floor of the expected error."""
_DOWN_M = 4e-3
"""Height above its lowest within which a tip is down, as the planner's `LOW_ENOUGH_M`."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Glance:
    """One push. Vectors lie on the table, in the base's frame.

    `error_m`: how far the object was from where it was predicted; `moved_m`: how far it was predicted to move, in the
    mean; `noise_m`: how far apart two views of it at rest are. `promised_m`: the error that the model said it would
    make, NaN where it said nothing. `residual_m`: from the predicted to the observed middle; `place_m`: that middle;
    `ahead`: the push's direction; `strayed_m`: from where the tip was told to end the push to where its log says;
    `late_s`: by how much its log is behind the command.
    """

    error_m: float
    moved_m: float
    noise_m: float
    promised_m: float
    residual_m: Float64[np.ndarray, "2"]
    place_m: Float64[np.ndarray, "2"]
    ahead: Float64[np.ndarray, "2"]
    strayed_m: Float64[np.ndarray, "2"]
    late_s: float

    @property
    def score(self) -> float:
        """The error as a share of what such a push would let one expect."""
        return self.error_m / _expected_m(self.moved_m, self.noise_m, _SHARE)


def glance(
    planned: Points,
    predicted: Points,
    before: Points,
    after: Points,
    executed: Executed,
    *,
    share: float = float("nan"),
    promised_m: float = float("nan"),
) -> Glance:
    """A push that was planned for the object at `planned` (N, 3), of which `predicted` (N, 3) are the same particles.

    The object was seen again at `before` (K, 3), and at `after` (L, 3) at the end [m]. The model said that it errs by
    `share` of its motion, or by `promised_m`, if it said so.
    """
    moved_m = float(np.linalg.norm(predicted.astype(np.float64) - planned, axis=1).mean())
    noise_m = drift(planned, before)
    ahead, strayed_m, late_s = _tracking_error(executed)
    middle = after[:, :2].mean(0, dtype=np.float64)
    return Glance(
        error_m=drift(predicted, after),
        moved_m=moved_m,
        noise_m=noise_m,
        promised_m=_expected_m(moved_m, noise_m, share) if np.isfinite(share) else promised_m,
        residual_m=middle - predicted[:, :2].mean(0, dtype=np.float64),
        place_m=middle,
        ahead=ahead,
        strayed_m=strayed_m,
        late_s=late_s,
    )


def _expected_m(moved_m: float, noise_m: float, share: float) -> float:
    return max(math.hypot(noise_m, share * moved_m), _LEAST_M)


def _tracking_error(executed: Executed) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"], float]:
    """The push's direction, the offset of the log's end, and its delay; none if there is no log."""
    told = Track(times_s=executed.times_s, poses=executed.commanded)
    low = _low(told.positions)
    ahead = told.positions[low[-1], :2] - told.positions[low[0], :2]
    length = float(np.linalg.norm(ahead))
    ahead = ahead / length if length > 0 else np.array([1.0, 0.0])
    if len(executed.measured) != len(executed.times_s):
        return ahead, np.zeros(2), 0.0
    made = executed.measured[:, :3]
    ends = _low(made)[-1]
    behind, velocity = (made - told.positions)[low, :2], told.velocity(told.times_s[low])[:, :2]
    moving = float((velocity**2).sum())
    late_s = -float((behind * velocity).sum()) / moving if moving > 0 else 0.0
    return ahead, made[ends, :2] - told.positions[low[-1], :2], late_s


def _low(way: Path3) -> Int[np.ndarray, " L"]:
    """Indices at which the tip is down: near its lowest."""
    heights = way[:, 2]
    return np.flatnonzero(heights <= heights.min() + _DOWN_M)
