"""Object, tool and table as imported data have them, so that these are simulated and not the task's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi, remainder
from typing import Any, Final, Literal, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError
from app.core.geometry.object_description import SIZES
from app.core.geometry.scene_description import Rope
from app.core.geometry.tool_surface import ToolView, fit_tool
from app.core.geometry.track import poses_at
from app.core.measured_setup import FoundTable, MeasuredSetup, Source, SourcedSize, ToolPoints
from app.core.task_name import TaskName
from app.core.types import Poses
from app.perception.cloud.table_plane import TablePlane, plane_of_clouds, plane_of_points
from app.recording.exchange.npz_import import Plain, PlainEpisode, PlainObservation
from app.recording.exchange.plain_checks import half_sides
from app.sim.rods.geometry.rope_size import rope_size
from app.tasks import load
from app.tasks.elements.base import Task

_STEEP_DEG: Final = 20.0
"""Largest credible tilt of a table with a rope on it against the arm's base."""
_UNDER_M: Final = 0.02
"""An object or a tool that is so far below the table is in another frame."""
_HIGH_M, _TILTED_DEG = 0.010, 0.7
"""Usual errors of cameras: three usual offsets, and a little more than a usual turn. A table that is farther from
height 0 is elsewhere."""
_CLOUDS_HIGH_M, _CLOUDS_TILTED_DEG = 0.020, 3.0
"""The same where only the object's lowest points are known, as cameras may not see its underside."""
_TURNS_RAD: Final = 0.09
"""A flat tool whose yaw differs by more than 5 degrees from push to push turns."""
_OTHER: Final = 0.15
"""Share of a size, beside three standard deviations, from which what is seen differs from what is said."""
_FAR_OTHER: Final = 0.25
_BESIDE_M: Final = 2e-3
"""Twice what a tool's middle, as cameras see it, is known to."""
_NEAR_M: Final = 0.025
_MM: Final = 1e3


def measured_setup(plain: Plain, task: Task) -> tuple[Plain, Task, MeasuredSetup]:
    """The data in the table's frame, the task with the object and the tool of the data, and who says what.

    Raises RecordingError where table, object and tool cannot be in one frame with z up, or where object or tool are of
    a size that nobody simulates.
    """
    plain, table, notes = _on_table(plain)
    found = _Found(plain=plain, task=task)
    sizes, tool = (*found.rope(), *found.tool()), found.tool_points
    named = TaskName.parse(task.name)
    resized = load(str(TaskName.of(named.problem, _changed_sizes(task, sizes), split=named.split)))
    near, pushes = _near(plain, resized), sum(len(episode.pushes) for episode in plain.episodes)
    if near < pushes:
        notes.append(
            f"The tool came within {_MM * _reach_m(resized):.0f} mm of the object in {near} of {pushes} pushes"
            + ("." if near else ": tool and object are not in one frame, or nothing was pushed.")
        )
    if not table.flat:
        found.flaws.insert(
            0,
            f"The table is not flat: parts of it lie {_MM * table.uneven_m:.0f} mm beside its plane.",
        )
    return (
        plain,
        resized,
        MeasuredSetup(
            sizes=sizes,
            table=table,
            tool_points=tool,
            push_height_m=float(np.median([_lowest_m(episode, sights) for episode, sights in _pushes(plain)])),
            camera_m=_camera_m(plain.about),
            flaws=tuple(found.flaws),
            notes=(*notes, *found.notes),
        ),
    )


def _on_table(plain: Plain) -> tuple[Plain, FoundTable, list[str]]:
    """The data in the frame of the table if that is not at height 0, and the table found."""
    points = [episode.table for episode in plain.episodes if len(episode.table)]
    seen: Literal["points", "clouds", "none"] = "points" if points else "clouds"
    plane = plane_of_points(np.concatenate(points)) if points else None
    if plane is None:
        plane, seen = plane_of_clouds([sight.cloud for _, push in _pushes(plain) for sight in push]), "clouds"
    if plane is None:
        return plain, FoundTable(), []
    _require_upright(plain, plane, seen)
    high, tilted = (_HIGH_M, _TILTED_DEG) if seen == "points" else (_CLOUDS_HIGH_M, _CLOUDS_TILTED_DEG)
    moved = abs(plane.height_m) > high or plane.tilt_deg > tilted
    if not moved and seen == "clouds":
        return plain, FoundTable(), []
    table = FoundTable(
        height_m=plane.height_m,
        tilt_deg=plane.tilt_deg,
        uneven_m=plane.uneven_m,
        flat=plane.flat,
        seen=seen,
        taken_out=moved,
    )
    notes = list[str]()
    if moved and seen == "clouds":
        notes.append(
            "Cameras may not see the underside of the object, so the table may be lower by its radius: give "
            "table_points, points of the bare table, once an episode."
        )
    return (_level(plain, plane) if moved else plain), table, notes


def _level(plain: Plain, plane: TablePlane) -> Plain:
    """The data transformed so that the plane is level and at height 0."""
    turn = plane.levelling

    def poses(given: Poses) -> Poses:
        quaternions = (turn * Rotation.from_quat(given[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
        # The signs as they were, or a tool that points down would seem to jump.
        signs = np.where((quaternions * given[:, 3:]).sum(1, keepdims=True) < 0, -1.0, 1.0)
        return np.concatenate([plane.above(given[:, :3]), signs * quaternions], axis=1)

    moved = plain.mapped(plane.above, poses)
    camera = _camera_m(plain.about)
    if camera is None:
        return moved
    return replace(moved, about={**plain.about, "camera_m": plane.above(np.array(camera)).tolist()})


def _require_upright(plain: Plain, plane: TablePlane, seen: str) -> None:
    """Raises RecordingError where the table is steep, or the object or the tool below it."""
    camera = (
        "the clouds seem to be in the camera's frame. Transform clouds, tool_points and table_points by the camera's "
        "pose into the robot's base frame, z up."
    )
    if plane.tilt_deg > _STEEP_DEG:
        raise RecordingError(f"The table is tilted by {plane.tilt_deg:.0f} degrees against the z axis: {camera}")
    object_m = float(np.median(plane.above(plain.episodes[0].pushes[0][0].cloud.astype(np.float64))[:, 2]))
    if seen == "points" and object_m < -_UNDER_M:
        raise RecordingError(f"The object is {-_MM * object_m:.0f} mm below the table: {camera}")
    lowest = [float(plane.above(_poses(episode, sights)[:, :3])[:, 2].min()) for episode, sights in _pushes(plain)]
    if max(lowest) < -max(_UNDER_M, 2 * abs(object_m)):
        raise RecordingError(
            f"The tool goes {-_MM * float(np.median(lowest)):.0f} mm below the table on which the object lies, so "
            f"clouds and poses are not in one frame: {camera}"
        )


@final
@dataclass(kw_only=True, eq=False)
class _Found:
    """Sizes of object and tool from what `about` says, what the data show, or the task."""

    plain: Plain
    task: Task

    def __post_init__(self) -> None:
        self.flaws, self.notes = list[str](), list[str]()
        self.tool_points: ToolPoints = "none"
        self._given = dict(TaskName.parse(self.task.name).sizes)

    def rope(self) -> tuple[SourcedSize, ...]:
        """Length, radius and mass."""
        length, radius, mass = (self._given_size("object", name, name) for name in ("length_m", "radius_m", "mass_kg"))
        still = [sight.cloud for _, push in _pushes(self.plain) for sight in push if sight.phase != "during"]
        seen = rope_size(still, None if radius is None else radius.value)
        if radius is None:
            radius = _size("radius_m", seen.radius_m, "data", seen.radius_sd_m)
        if length is None:
            length = _size("length_m", seen.length_m, "data", seen.length_sd_m)
        else:
            self._compare("the object", "long", length.value, seen.length_m, seen.length_sd_m)
        if mass is None:
            own = self.task.rope
            mass = _size("mass_kg", own.mass_kg / _volume_m3(own.length_m, own.radius_m), "task")
            mass = replace(mass, value=_round(mass.value * _volume_m3(length.value, radius.value)))
        return length, radius, mass

    def tool(self) -> tuple[SourcedSize, ...]:
        """Radius, half width and yaw of the tool, as `shapes.tools.Finger` has them."""
        radius, half, yaw = self._said_tool()
        views, of = _tool_views(self.plain), self.plain.about.get("tool", {})
        shape = of.get("shape") if isinstance(of, Mapping) else None
        flat = None if half is None and shape is None else shape == "box" or (half is not None and half.value > 0)
        surface = fit_tool(views, flat=flat)
        if any(len(view.points) for view in views):
            self.tool_points = "surface" if surface is not None else "tip"
        own = self.task.finger
        if surface is not None and surface.radius_m is not None:
            beside_m = float(np.hypot(*surface.beside_m))
            if beside_m > _BESIDE_M:
                self.notes.append(f"The tool's middle is seen {_MM * beside_m:.1f} mm beside the tip of the poses.")
        if surface is not None:
            if radius is None and surface.radius_m is not None:
                radius = _size("finger_radius_m", surface.radius_m, "data", surface.radius_sd_m)
            elif radius is not None and surface.radius_m is not None:
                self._compare("the tool", "in radius", radius.value, surface.radius_m, surface.radius_sd_m)
        said = radius is not None
        radius = radius or _size("finger_radius_m", own.radius_m, "task")
        if not said:
            self.notes.append(
                f"Neither about nor tool_points say how thick the tool is: {_MM * own.radius_m:.0f} mm in radius are "
                "the task's. Give tool.radius_m in about."
            )
        if half is None:
            wide = surface is not None and surface.flat and surface.half_length_m is not None
            if surface is not None and wide and said:
                width = max(float(surface.half_length_m or 0.0) - radius.value, 0.0)
                half = _size("finger_half_width_m", width, "data", surface.radius_sd_m)
            elif flat is False or (surface is not None and not surface.flat and said):
                half = _size("finger_half_width_m", 0.0, "about" if flat is False else "data")
            else:
                half = _size("finger_half_width_m", own.half_width_m, "task")
        if half.value == 0:
            return radius, half, _size("finger_yaw_rad", 0.0, half.source)
        return radius, half, self._yaw(yaw, surface.yaw_rad if surface is not None and surface.flat else None)

    def _yaw(self, said: SourcedSize | None, seen: float | None) -> SourcedSize:
        """Yaw of a flat tool: as said, as seen, or as the poses have it, about which it is said to be."""
        turns = np.concatenate([_yaws(_low_poses(episode, sights)) for episode, sights in _pushes(self.plain)])
        usual = 0.5 * float(np.angle(np.mean(np.exp(2j * turns))))
        spread = float(np.quantile(np.abs(_half_turn(turns - usual)), 0.9))
        if spread > _TURNS_RAD:
            self.flaws.append(
                f"The flat tool turns by {np.degrees(spread):.0f} degrees from push to push; the simulated one "
                "does not."
            )
        if said is not None:
            return said
        if seen is not None:
            return _size("finger_yaw_rad", seen, "data", 0.02)
        across = half_sides(self.plain.about)
        quarter = pi / 2 if across is not None and across[1] > across[0] else 0.0
        return _size("finger_yaw_rad", float(_half_turn(np.array([usual + quarter]))[0]), "about")

    def _said_tool(self) -> tuple[SourcedSize | None, SourcedSize | None, SourcedSize | None]:
        radius = self._given_size("tool", "radius_m", "finger_radius_m")
        half = self._given_size("tool", "half_width_m", "finger_half_width_m")
        sides = half_sides(self.plain.about)
        if sides is not None:
            thin, wide = sorted(sides)
            radius = _size("finger_radius_m", thin, "about")
            half = _size("finger_half_width_m", wide - thin, "about")
        return radius, half, self._given_size("tool", "yaw_rad", "finger_yaw_rad")

    def _given_size(self, thing: str, key: str, name: str) -> SourcedSize | None:
        """Size given by `about`, or by the task's name."""
        of = self.plain.about.get(thing, {})
        value: Any = of.get(key) if isinstance(of, Mapping) else None
        value = self._given.get(name) if value is None else value
        return None if value is None else SourcedSize(name=name, value=float(value), source="about")

    def _compare(self, thing: str, how: str, said: float, seen: float, sd: float) -> None:
        """Says where the data contradict `about`."""
        apart = abs(seen - said)
        if apart < max(_OTHER * said, 3 * sd):
            return
        text = (
            f"About says that {thing} is {_MM * said:.3g} mm {how}, and the data show {_MM * seen:.3g} mm; about's is "
            "simulated."
        )
        (self.flaws if apart > _FAR_OTHER * said else self.notes).append(text)


def _size(name: str, value: float, source: Source, sd: float = 0.0) -> SourcedSize:
    size = _round(value) if source == "data" else float(value)
    return SourcedSize(name=name, value=size, source=source, sd=float(sd))


def _round(value: float) -> float:
    """The value with three digits, more than the data determine."""
    return float(f"{value:.3g}")


def _changed_sizes(task: Task, sizes: Sequence[SourcedSize]) -> dict[str, float]:
    """Sizes that differ from the task's own. Raises RecordingError for one that is not simulated."""
    own = {
        **{name: getattr(task.rope, name) for name in ("length_m", "radius_m", "mass_kg")},
        **{f"finger_{name}": getattr(task.finger, name) for name in ("radius_m", "half_width_m", "yaw_rad")},
    }
    given = dict(TaskName.parse(task.name).sizes)
    for size in sizes:
        low, high = SIZES[size.name]
        if not low <= size.value <= high:
            who = {"data": "The data show", "about": "about says", "task": "The task has"}[size.source]
            raise RecordingError(
                f"{who} {size.name} = {size.value:.3g}; what is simulated truly is from {low:g} to {high:g}. Check the "
                "units and what the clouds show, or give its size in about."
            )
        if size.value != own[size.name]:
            given[size.name] = size.value
    return given


def _volume_m3(length_m: float, radius_m: float) -> float:
    return pi * radius_m**2 * length_m


def _pushes(plain: Plain) -> list[tuple[PlainEpisode, tuple[PlainObservation, ...]]]:
    return [(episode, push) for episode in plain.episodes for push in episode.pushes]


def _poses(episode: PlainEpisode, sights: Sequence[PlainObservation]) -> Poses:
    """Poses of a push, as measured if they were."""
    first, last = sights[0].time_s, sights[-1].time_s
    measured = episode.state.between(first, last) if episode.state is not None else None
    return (measured if measured is not None and len(measured.times_s) else episode.command.between(first, last)).poses


def _lowest_m(episode: PlainEpisode, sights: Sequence[PlainObservation]) -> float:
    return float(_poses(episode, sights)[:, 2].min())


def _low_poses(episode: PlainEpisode, sights: Sequence[PlainObservation]) -> Poses:
    poses = _poses(episode, sights)
    return poses[poses[:, 2] <= poses[:, 2].min() + 0.004]


def _yaws(poses: Poses) -> Float64[np.ndarray, " T"]:
    """Angles of the tool's x axis about the vertical [rad]."""
    ahead = Rotation.from_quat(poses[:, 3:], scalar_first=True).apply(np.array([1.0, 0.0, 0.0]))
    return np.arctan2(ahead[:, 1], ahead[:, 0])


def _half_turn(angles: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """The same directions of a line, from -pi/2 to pi/2."""
    return np.array([remainder(angle, pi) for angle in angles.tolist()])


def _tool_views(plain: Plain) -> list[ToolView]:
    """Points of the tool in views during pushes, with the tip as measured, or as commanded."""
    views = list[ToolView]()
    for episode, push in _pushes(plain):
        line = episode.state if episode.state is not None else episode.command
        for sight in push:
            if sight.phase == "during" and len(sight.tool):
                tip = poses_at(np.array([sight.time_s]), line.times_s, line.poses)[0, :3]
                views.append(ToolView(points=sight.tool, tip=tip))
    return views


def _reach_m(task: Task) -> float:
    """Distance from the tool's middle to the nearest point of an object that it touches, with a margin."""
    finger = task.finger
    return max(_NEAR_M, finger.radius_m + finger.half_width_m + task.rope.radius_m + 0.005)


def _near(plain: Plain, task: Task) -> int:
    """Pushes in which the tool came near the object, low enough to touch it."""
    count = 0
    for episode, push in _pushes(plain):
        poses = _poses(episode, push)
        low = poses[poses[:, 2] < max(2 * task.rope.radius_m, task.finger.push_height_m + 0.004), :2]
        count += bool(len(low)) and float(np.min(KDTree(push[0].cloud[:, :2]).query(low)[0])) < _reach_m(task)
    return count


def _camera_m(about: Mapping[str, Any]) -> tuple[float, float, float] | None:
    """Middle of the cameras [m], if `about` gives it."""
    value: Any = about.get("camera_m")
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3 or not all(isinstance(it, int | float) for it in value):
        raise RecordingError(f"about says that camera_m is {value!r}; give x, y, z in metres, as [0.5, 0.0, 0.9].")
    x, y, z = map(float, value)
    return x, y, z


def is_of_rope(task: Task) -> bool:
    """True where the object is a rope that is simulated at any size."""
    return isinstance(task.stage.body, Rope) and task.sized is not None and task.rods is not None
