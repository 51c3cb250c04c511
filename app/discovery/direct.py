"""What needs no simulation: the finger as seen, the bare table, and the arm's own log against its command.

These see errors of cameras and arm before physics is blamed for them. They are further rows of the residuals of the
pushes, with slopes of their own, so that one inference weighs them together with the clouds.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from app.core.types import Cloud
from app.discovery.apparatus.base import Eye
from app.discovery.evidence import Block
from app.discovery.predict import Predictor, Trials
from app.discovery.study import Push
from app.discovery.subject import Theta
from app.sim.params import PARAMETERS

_PHASES = 8
"""Moments of a push at which the arm's log is compared with its command."""
_ARM_M = 0.3
"""A slope of the table counts as the height that it makes over this length."""
_FINGER, _TABLE, _LOG = 3, 3, 2 * _PHASES
_LEAST_M = (5e-4, 3e-4, 2e-4)
"""How exact finger, table and log are at best, however many points are averaged: half a millimetre of bias in seeing
a finger or a table, and a fifth in following a command, is not worth a name."""
_LEAST_POINTS = 3


class Change(NamedTuple):
    """Two models, and how many steps of a parameter they are apart."""

    up: Theta
    down: Theta
    apart: float


class DirectRows(NamedTuple):
    """Residuals (K, R) [m], slopes (K, R, P) [m a step], and which of them were measured."""

    r: Float64[np.ndarray, "K R"]
    J: Float64[np.ndarray, "K R P"]
    known: Bool[np.ndarray, "K R"]


def direct_blocks(first: int) -> tuple[Block, ...]:
    """Finger, table and log as blocks of rows, from row `first` on."""
    ends = first + np.cumsum([0, _FINGER, _TABLE, _LOG])
    return tuple(
        Block(slice(int(low), int(high)), least) for low, high, least in zip(ends[:-1], ends[1:], _LEAST_M, strict=True)
    )


def direct_rows(predictor: Predictor, trials: Trials, about: Theta, changes: Sequence[Change]) -> DirectRows:
    """Of all pushes about a model, and what changes of it do."""
    first, physics = _first_of_episodes(trials), len(PARAMETERS)
    seen = [
        (column, change)
        for column, change in enumerate(changes)
        if change.apart > 0 and (change.up != change.down)[physics:].any()
    ]
    sources: list[tuple[int, Callable[[int, Theta], Float64[np.ndarray, " S"] | None]]] = [
        (_FINGER, lambda k, theta: _finger(predictor, trials, k, theta)),
        (_TABLE, lambda k, theta: _table(predictor, trials, k, theta) if k in first else None),
        (_LOG, lambda k, theta: _log(predictor, trials, k, theta)),
    ]
    count, rows = len(trials), sum(width for width, _ in sources)
    r, J = np.zeros((count, rows)), np.zeros((count, rows, len(changes)))
    known = np.zeros((count, rows), bool)
    at = 0
    for width, residual in sources:
        for k in range(count):
            here = residual(k, about)
            if here is None:
                continue
            own = slice(at, at + width)
            r[k, own], known[k, own] = here, True
            for column, change in seen:
                above, below = residual(k, change.up), residual(k, change.down)
                if above is not None and below is not None:
                    J[k, own, column] = (below - above) / change.apart  # A residual falls as its prediction rises.
        at += width
    return DirectRows(r, J, known)


def _first_of_episodes(trials: Trials) -> frozenset[int]:
    """The first push of each episode: the table is one view of an episode, and counts once."""
    episodes = [push.episode for push in trials.study.pushes]
    return frozenset(episodes.index(episode) for episode in set(episodes))


def _finger(predictor: Predictor, trials: Trials, k: int, theta: Theta) -> Float64[np.ndarray, "3"] | None:
    """The middle of the finger's points in the view on the way, less where the kinematics and the model put it."""
    push = trials.study.pushes[k]
    view = next((view for view in push.during if view.time_s == trials.stops_s[k]), None)
    if view is None or view.finger is None or len(view.finger) < _LEAST_POINTS:
        return None
    track = predictor.driven(push, trials.loads[k], theta)
    tip = track.at(np.array([view.time_s + predictor.late_s(theta)]))
    return view.finger.mean(0) - predictor.placed(tip, _eye(trials), theta)[0]


def _table(predictor: Predictor, trials: Trials, k: int, theta: Theta) -> Float64[np.ndarray, "3"] | None:
    """Height and slopes of the table as seen, less those of the plane z = 0 as the model would show it."""
    points = trials.study.tables.get(trials.study.pushes[k].episode)
    if points is None or len(points) < _LEAST_POINTS:
        return None
    level = np.concatenate([points[:, :2], np.zeros((len(points), 1))], axis=1).astype(np.float64)
    return _plane(points) - _plane(predictor.placed(level, _eye(trials), theta))


def _plane(points: Cloud | Float64[np.ndarray, "M 3"]) -> Float64[np.ndarray, "3"]:
    """The plane through points, by least squares: height [m] in their middle, and what it rises over `_ARM_M` [m]."""
    xy = points[:, :2] - points[:, :2].mean(0)
    rows = np.concatenate([np.ones((len(xy), 1)), xy / _ARM_M], axis=1).astype(np.float64)
    return np.linalg.lstsq(rows, points[:, 2].astype(np.float64), rcond=None)[0]


def _log(predictor: Predictor, trials: Trials, k: int, theta: Theta) -> Float64[np.ndarray, " L"] | None:
    """Measured less commanded positions, along and across the push, where the command goes through the model's arm."""
    push = trials.study.pushes[k]
    if push.measured is None:
        return None
    times, ahead = _phases(push, predictor.subject.low_m)
    apart = push.measured.at(times) - predictor.told(push.command, trials.loads[k], theta).at(times)
    across = np.array([-ahead[1], ahead[0]])
    return np.concatenate([apart[:, :2] @ ahead, apart[:, :2] @ across])


def _phases(push: Push, low_m: float) -> tuple[Float64[np.ndarray, " S"], Float64[np.ndarray, "2"]]:
    """Moments at even intervals while the commanded tool is low, and the direction in which it goes."""
    low = np.flatnonzero(push.command.poses[:, 2] < low_m)
    if not len(low):
        low = np.array([0, len(push.command.times_s) - 1])
    times, xy = push.command.times_s[low], push.command.positions[low, :2]
    farthest = xy[np.argmax(np.linalg.norm(xy - xy[0], axis=1))] - xy[0]
    length = float(np.linalg.norm(farthest))
    ahead = farthest / length if length > 0 else np.array([1.0, 0.0])
    return np.linspace(times[0], times[-1], _PHASES), ahead


def _eye(trials: Trials) -> Eye:
    return Eye(np.asarray(trials.study.camera), None)
