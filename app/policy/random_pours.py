"""Random motions of a held bowl of liquid: over a fixed one, tilted and held there, and on to another side of it."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.bowls import cap_depth_m
from app.core.geometry.track import Track
from app.policy.random_pushes import PERIOD_S, PushDesign

ASIDE_M: Final = 0.145
"""Distance from the axis of the fixed bowl at which the held one rests between motions."""
_MOVES_S, _HOLDS_S = (0.8, 1.4), (0.1, 0.5)
"""Ranges of the time over or back, and of that in which the bowl is held tilted."""
_WAIT_S: Final = 0.1
_SHARES: Final = (0.15, 0.6)
"""Range of the share of what is left that flows out if it has the time for it."""
_SWINGS, _SWINGS_RAD = 0.15, (0.1, 0.3)
"""Share of motions that only swing the liquid, and their tilts."""
_SHORT_M, _AIM_M = 0.02, 0.01
"""Distance of the lip from the fixed bowl's axis, and standard deviation of where it is, along x and y."""
_TURN_RAD = 1.0, 2 * np.pi - 1.0
"""Range of the turn about the fixed bowl from where a motion begins to where it ends."""
WATER_FURTHER_RAD, _STEEPEST_RAD = (0.0, 0.2), 1.45
"""Range of the tilt beyond that in which so much would rest, which makes it flow in time; and the most."""
SOUP_FURTHER_RAD = (0.05, 0.35)
"""The same of a soup, whose pieces dam it until they slide over the lip: less lets hardly anything out, more all."""


def pour_design(episodes: int, pushes: int) -> PushDesign:
    """Design of an experiment with so many random motions of the bowl; each episode begins with all of the liquid."""
    return PushDesign(episodes=episodes, pushes=pushes)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PourMotion:
    """A motion of an upright bowl, its centre at a height of `height_m`, from `start` over `over` to `end` [m, x y].

    There its axis leans by `tilt_rad` along the unit vector `toward`. It takes `over_s` to get there, is held for
    `hold_s`, and takes `back_s` on.
    """

    start: Float64[np.ndarray, "2"]
    over: Float64[np.ndarray, "2"]
    end: Float64[np.ndarray, "2"]
    toward: Float64[np.ndarray, "2"]
    tilt_rad: float
    height_m: float
    over_s: float
    hold_s: float
    back_s: float

    @property
    def midway_s(self) -> float:
        """Time from its beginning to the end of being held: the later it is, the more has flowed."""
        return _WAIT_S + self.over_s + self.hold_s

    def track(self, *, start_s: float) -> Track:
        """The poses: rest, over while it tilts, held, upright again on the way to its end, and rest."""
        ends = np.cumsum([_WAIT_S, self.over_s, self.hold_s, self.back_s, _WAIT_S])
        times = np.arange(0.0, ends[-1] + PERIOD_S, PERIOD_S)
        to, back = (np.clip((times - ends[at]) / span, 0.0, 1.0) for at, span in ((0, self.over_s), (2, self.back_s)))
        there, on = _smooth(to)[:, None], _smooth(back)[:, None]
        xy = self.start + there * (self.over - self.start) + on * (self.end - self.over)
        # It tilts in the later part of the way there, and is upright again in the first part of the way back.
        tilted, upright = (np.clip(1.5 * to - 0.5, 0, 1), np.clip(1.5 * back, 0, 1))
        lean = self.tilt_rad * (_smooth(tilted) - _smooth(upright))
        axis = np.array([-self.toward[1], self.toward[0], 0.0])
        down = Rotation.from_quat([0.0, 1.0, 0.0, 0.0], scalar_first=True)
        turns = (Rotation.from_rotvec(lean[:, None] * axis) * down).as_quat(scalar_first=True)
        turns *= np.where(turns[:, 1:2] < 0, -1.0, 1.0)
        height = np.full((len(times), 1), self.height_m)
        return Track(times_s=start_s + times, poses=np.concatenate([xy, height, turns], axis=1))


def random_pour(
    rng: np.random.Generator,
    start: Float64[np.ndarray, "3"],
    around: tuple[float, float],
    *,
    volume_m3: float,
    radius_m: float,
    further_rad: tuple[float, float] = WATER_FURTHER_RAD,
) -> PourMotion:
    """Random motion of a bowl of inner radius `radius_m` at `start` [m] towards a fixed one about `around` (x, y) [m].

    `volume_m3`: of the liquid in it. It is tilted by as much as lets a random share of it out, and by a random angle of
    `further_rad` beyond, which makes it flow in time; or so little that none comes out.
    """
    away = start[:2] - around
    toward = -away / np.linalg.norm(away)
    share = rng.uniform(*_SHARES)
    depth = cap_depth_m((1 - share) * volume_m3, radius_m)
    tilt = float(np.arcsin(1 - min(depth / radius_m, 1.0)) + rng.uniform(*further_rad))
    tilt = min(tilt, _STEEPEST_RAD)
    if rng.uniform() < _SWINGS:
        tilt = float(rng.uniform(*_SWINGS_RAD))
    lip_m = radius_m * np.cos(tilt) + _SHORT_M
    over = np.asarray(around) - lip_m * toward + _AIM_M * rng.standard_normal(2)
    angle = float(np.arctan2(away[1], away[0]) + rng.uniform(*_TURN_RAD))
    (over_s, back_s), hold_s = rng.uniform(*_MOVES_S, 2).tolist(), float(rng.uniform(*_HOLDS_S))
    return PourMotion(
        start=start[:2].copy(),
        over=over,
        end=beside(around, angle),
        toward=toward,
        tilt_rad=tilt,
        height_m=float(start[2]),
        over_s=over_s,
        hold_s=hold_s,
        back_s=back_s,
    )


def beside(around: tuple[float, float], angle_rad: float) -> Float64[np.ndarray, "2"]:
    """Place of the held bowl (x, y) [m] beside the fixed one, at an angle about it from x."""
    return np.asarray(around) + ASIDE_M * np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _smooth(share: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """Share of a way whose speed rises and falls like sin^2."""
    return share - np.sin(2 * np.pi * share) / (2 * np.pi)
