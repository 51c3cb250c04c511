"""Direct measurements, without simulation: the finger as seen, the bare table, and the arm's log against its command.

These reveal errors of cameras and arm before physics is blamed for them. They are further rows of the residuals of the
pushes, with slopes of their own, so that one inference weighs them together with the clouds.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from app.core.geometry.tool_surface import ToolView, middle_of
from app.core.types import Cloud
from app.discovery.dataset.model_under_test import Theta
from app.discovery.dataset.study import Push
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Block
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.sensor_actuator_errors.base import Eye
from app.sim.model.params import PARAMETERS

_PHASES = 8
"""Moments of a push at which the arm's log is compared with its command."""
_ARM_M = 0.3
"""A slope of the table counts as the height that it makes over this length."""
_WIDTHS = {"finger": 3, "table": 3, "log": 2 * _PHASES, "girth": 1}
LEAST_M = {"finger": 5e-4, "table": 3e-4, "log": 2e-4, "girth": 3e-4}
"""Least error of each kind, however many points are averaged: half a millimetre of bias in seeing a finger, a third in
seeing a table or a rope, and a fifth in following a command, is not worth a name."""
_HALF_INSIDE = 0.404
"""Half of a disc lies nearer than u radii to a line through its middle: 2/pi (asin u + u sqrt(1 - u^2)) = 1/2."""
_LEAST_POINTS = 3


class Change(NamedTuple):
    """Two models, and the number of steps of a parameter between them."""

    up: Theta
    down: Theta
    apart: float


class DirectRows(NamedTuple):
    """Residuals (K, R) [m], slopes (K, R, P) [m a step], and which of them were measured."""

    r: Float64[np.ndarray, "K R"]
    J: Float64[np.ndarray, "K R P"]
    known: Bool[np.ndarray, "K R"]


def row_of(kind: str) -> slice:
    """Row indices of finger, table, log or girth."""
    before = list(_WIDTHS).index(kind)
    first = sum(list(_WIDTHS.values())[:before])
    return slice(first, first + _WIDTHS[kind])


def direct_blocks(first: int) -> tuple[Block, ...]:
    """Each kind as a block of rows, from row `first` on."""
    own = {kind: row_of(kind) for kind in _WIDTHS}
    return tuple(Block(slice(first + at.start, first + at.stop), LEAST_M[kind]) for kind, at in own.items())


def direct_rows(predictor: Predictor, trials: SimulationBatch, about: Theta, changes: Sequence[Change]) -> DirectRows:
    """Residuals of all pushes about a model, and their slopes for its changes."""
    first, physics = _first_of_episodes(trials), len(PARAMETERS)
    seen_at = [_seen_tip(predictor, trials, k) for k in range(len(trials))]
    seen = [
        (column, change)
        for column, change in enumerate(changes)
        if change.apart > 0 and (change.up != change.down)[physics:].any()
    ]
    sources: dict[str, Callable[[int, Theta], Float64[np.ndarray, " S"] | None]] = {
        "finger": lambda k, theta: _finger(predictor, trials, seen_at[k], k, theta),
        "table": lambda k, theta: _table(predictor, trials, k, theta) if k in first else None,
        "log": lambda k, theta: _log(predictor, trials, k, theta),
        "girth": lambda k, theta: _girth(predictor, trials, k, theta),
    }
    count, rows = len(trials), sum(_WIDTHS.values())
    r, J = np.zeros((count, rows)), np.zeros((count, rows, len(changes)))
    known = np.zeros((count, rows), bool)
    for kind, residual in sources.items():
        own = row_of(kind)
        for k in range(count):
            here = residual(k, about)
            if here is None:
                continue
            r[k, own], known[k, own] = np.nan_to_num(here), np.isfinite(here)
            for column, change in seen:
                above, below = residual(k, change.up), residual(k, change.down)
                if above is not None and below is not None:
                    J[k, own, column] = (
                        np.nan_to_num(below - above) / change.apart
                    )  # A residual falls as its prediction rises.
    return DirectRows(r, J, known)


def best_by_log(predictor: Predictor, trials: SimulationBatch, models: Sequence[Theta]) -> int:
    """The number of the model with which the arm's log differs least from its command, in the sum of squares."""

    def misfit(theta: Theta) -> float:
        logs = (_log(predictor, trials, k, theta) for k in range(len(trials)))
        return sum(float(log @ log) for log in logs if log is not None)

    return int(np.argmin([misfit(theta) for theta in models]))


def _first_of_episodes(trials: SimulationBatch) -> frozenset[int]:
    """The first push of each episode: the table is one view of an episode, and counts once."""
    episodes = [push.episode for push in trials.study.pushes]
    return frozenset(episodes.index(episode) for episode in set(episodes))


def _seen_tip(predictor: Predictor, trials: SimulationBatch, k: int) -> Float64[np.ndarray, "3"] | None:
    """Tip of the tool as the cameras see it in the view on the way; NaN along an axis of which its points say nothing.

    Points whose mean is the tip say all of it. Points of the tool's surface say where its middle is, seen from above,
    where the tool's size is known; how low its tip is faces away from cameras above it.
    """
    push, setup = trials.study.pushes[k], trials.study.setup
    view = next((view for view in push.during if view.time_s == trials.stops_s[k]), None)
    if view is None or view.finger is None or len(view.finger) < _LEAST_POINTS:
        return None
    if setup is None or setup.tool_points != "surface":
        return view.finger.mean(0).astype(np.float64)
    finger = predictor.subject.finger
    if finger is None or "task" in (setup.source("finger_radius_m"), setup.source("finger_half_width_m")):
        return None
    tip = push.track.at(np.array([view.time_s]))[0]
    middle = middle_of(ToolView(points=view.finger, tip=tip), finger.radius_m, finger.half_m)
    return None if middle is None else np.array([*middle, np.nan])


def _finger(
    predictor: Predictor, trials: SimulationBatch, seen: Float64[np.ndarray, "3"] | None, k: int, theta: Theta
) -> Float64[np.ndarray, "3"] | None:
    """The finger as seen, less its position by the kinematics and the model."""
    if seen is None:
        return None
    push = trials.study.pushes[k]
    track = predictor.actual_track(push, trials.loads[k], theta)
    tip = track.at(np.array([trials.stops_s[k] + predictor.late_s(theta)]))
    return seen - predictor.project(tip, _eye(trials), theta)[0]


def _table(predictor: Predictor, trials: SimulationBatch, k: int, theta: Theta) -> Float64[np.ndarray, "3"] | None:
    """Height and slopes of the table as seen, less those of the plane z = 0 as the model would show it.

    Nothing where the table was taken for that plane, because nobody had said where it is.
    """
    points, setup = trials.study.tables.get(trials.study.pushes[k].episode), trials.study.setup
    if points is None or len(points) < _LEAST_POINTS or (setup is not None and setup.table.taken_out):
        return None
    level = np.concatenate([points[:, :2], np.zeros((len(points), 1))], axis=1).astype(np.float64)
    return _plane(points) - _plane(predictor.project(level, _eye(trials), theta))


def _plane(points: Cloud | Float64[np.ndarray, "M 3"]) -> Float64[np.ndarray, "3"]:
    """Plane through points, by least squares: height [m] in their middle, and its rise over `_ARM_M` [m]."""
    xy = points[:, :2] - points[:, :2].mean(0)
    rows = np.concatenate([np.ones((len(xy), 1)), xy / _ARM_M], axis=1).astype(np.float64)
    return np.linalg.lstsq(rows, points[:, 2].astype(np.float64), rcond=None)[0]


def _log(predictor: Predictor, trials: SimulationBatch, k: int, theta: Theta) -> Float64[np.ndarray, " L"] | None:
    """Measured less commanded positions, along and across the push, where the command goes through the model's arm."""
    push = trials.study.pushes[k]
    if push.measured is None:
        return None
    times, ahead = _phases(push, predictor.subject.low_m)
    apart = push.measured.at(times) - predictor.encoder_track(push.command, trials.loads[k], theta).at(times)
    across = np.array([-ahead[1], ahead[0]])
    return np.concatenate([apart[:, :2] @ ahead, apart[:, :2] @ across])


def _girth(predictor: Predictor, trials: SimulationBatch, k: int, theta: Theta) -> Float64[np.ndarray, "1"] | None:
    """Distance within which half of the object's points are from its middle line, less that of an object of its radius.

    Nothing where nobody said the radius, or it has no length.
    """
    if not trials.kind.has_length or "radius_m" in predictor.subject.unsaid:
        return None
    eye = Eye(np.asarray(trials.study.camera), trials.middles[k].astype(np.float64))
    points, middles = (
        predictor.unproject(seen, eye, theta) for seen in (trials.study.pushes[k].before.points, trials.middles[k])
    )
    tangent = trials.labels[k, :, 2:4]
    out = points[:, :2] - middles[:, :2]
    beside = np.abs(out[:, 1] * tangent[:, 0] - out[:, 0] * tangent[:, 1])
    return np.array([float(np.median(beside)) - _HALF_INSIDE * predictor.subject.radius_m])


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


def _eye(trials: SimulationBatch) -> Eye:
    return Eye(np.asarray(trials.study.camera), None)
