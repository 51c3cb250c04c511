"""Known errors of cameras and arm, put into recordings of what really happened.

The world stays as it was, its noise too; what cameras and arm say of it is made wrong. Cameras show everything through
the error. Of an arm that errs, the command is that which would have led it where it went: what it measures of itself
stays, unless it is blind to the error.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from types import MappingProxyType
from typing import Final, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.errors import UsageError
from app.core.geometry.track import Track
from app.discovery import sensor_actuator_errors
from app.discovery.dataset.labels import label_particles
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, See, Values

Undo: TypeAlias = Callable[[Track, Values], Track]
"""Inverse of an arm's effect: the commanded track for a true one."""
_LOW_M: Final = 0.004
"""Height below which a stroke begins, as in `under_reach`."""


def effect_of(name: str) -> Apparatus:
    """The effect of cameras or arm of that name."""
    return import_module(f"{sensor_actuator_errors.__name__}.{name}").EFFECT


def with_error(study: Study, name: str, values: Values) -> Study:
    """The study as it would be if the apparatus had the effect `name` with these values, in its parameters' units.

    Raises UsageError for an effect of the arm that cannot be undone.
    """
    effect = effect_of(name)
    if effect.see is not None:
        return _seen(study, effect.see, values)
    if effect.late_s is not None:
        return _stamped(study, effect.late_s(values))
    if name not in UNDONE:
        raise UsageError.unknown("effect of the arm that can be put into recordings", name, list(UNDONE))
    return replace(study, pushes=tuple(_told(push, effect, UNDONE[name], values) for push in study.pushes))


def _seen(study: Study, see: See, values: Values) -> Study:
    """The study as cameras with this error observe it."""
    position = np.asarray(study.camera)

    def shown(points: np.ndarray, middle: np.ndarray | None = None) -> np.ndarray:
        return see(points.astype(np.float64), Eye(position, middle), values).astype(np.float32)

    def view(at: ProjectionView) -> ProjectionView:
        middle = label_particles([at.points])[1][0].astype(np.float64)
        finger = None if at.finger is None else shown(at.finger)
        return replace(at, points=shown(at.points, middle), finger=finger)

    pushes = tuple(
        replace(push, before=view(push.before), during=tuple(map(view, push.during)), after=view(push.after))
        for push in study.pushes
    )
    return replace(study, pushes=pushes, tables={episode: shown(table) for episode, table in study.tables.items()})


def _stamped(study: Study, late_s: float) -> Study:
    """The study with images that are younger than their stamps."""

    def view(at: ProjectionView) -> ProjectionView:
        return replace(at, time_s=at.time_s - late_s)

    pushes = tuple(
        replace(push, before=view(push.before), during=tuple(map(view, push.during)), after=view(push.after))
        for push in study.pushes
    )
    return replace(study, pushes=pushes)


def _told(push: Push, effect: Apparatus, undo: Undo, values: Values) -> Push:
    """The push with the command that leads an arm of this effect along its true path."""
    blind = push.measured is not None and not effect.told
    measured = undo(push.measured, values) if push.measured is not None and blind else push.measured
    return replace(push, command=undo(push.command, values), measured=measured)


def _beside(track: Track, values: Values) -> Track:
    turned = Rotation.from_quat(track.poses[:, 3:], scalar_first=True).apply(values)
    return track.with_positions(track.positions - turned)


def _earlier(track: Track, values: Values) -> Track:
    return Track(times_s=track.times_s - values[0], poses=track.poses)


def _farther(track: Track, values: Values) -> Track:
    low = track.poses[:, 2] <= track.poses[:, 2].min() + _LOW_M
    start, positions = track.positions[low][0, :2], track.positions.copy()
    positions[:, :2] = start + (positions[:, :2] - start) / (1 - values[0])
    return track.with_positions(positions)


def _leading(track: Track, values: Values) -> Track:
    """Half of the dead band ahead, on the side to which the tip moved last."""
    positions = track.positions.copy()
    for axis in (0, 1):
        sides, last = np.sign(np.diff(track.positions[:, axis], prepend=track.positions[0, axis])), 0.0
        for k, side in enumerate(sides):
            last = side or last
            positions[k, axis] += last * values[0] / 2
    return track.with_positions(positions)


UNDONE: Final[Mapping[str, Undo]] = MappingProxyType(
    {
        "backlash": _leading,
        "command_delay": _earlier,
        "tcp_offset": _beside,
        "under_reach": _farther,
    }
)
"""Effects of the arm, and of the tool, that can be put into recordings."""
