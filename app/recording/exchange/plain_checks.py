"""Validation of the plain import format; every error names the array and the first bad index."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from jaxtyping import Float32, Float64, Int64

from app.core.errors import RecordingError
from app.core.types import Poses

_FEWEST_POINTS: Final = 30
"""Least number of points in a cloud: fewer do not locate each part of the object."""
_LARGEST: Final = 10**300
_POINT_M: Final = 1e-3
"""Extent below which points are one point, and no object."""
_FARTHEST_M: Final = 5.0
_HEAVIEST_KG: Final = 100.0
"""Limits of plausibility: no tabletop arm reaches as far, and no object on a table is as heavy."""
_MOST_YAW_RAD: Final = 3.142
_SIZES: Final = (("object", "length_m"), ("object", "radius_m"), ("tool", "radius_m"), ("tool", "half_width_m"))
_SHAPES: Final = ("cylinder", "box")
_FASTEST_M_S: Final = 10.0
_LONGEST_PUSH_S: Final = 600.0
_EARLIEST_S, _LATEST_S = -1.0e6, 2.4e9
"""Bounds of plausible times: seconds since 1970 lie within; milliseconds and nanoseconds do not."""
_UNIT_TOLERANCE: Final = 0.02
_COILED: Final = 1.5
"""Largest extent of a cloud, in lengths of the object: it may stretch, and sensors err."""


def as_array(
    name: str, arrays: Mapping[str, np.ndarray], shape: tuple[int | None, ...], kind: type[np.generic]
) -> np.ndarray:
    """The array as numbers of `kind`. Raises RecordingError where it has another shape (None: any length) or type."""
    array = arrays[name]
    fits = len(array.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise RecordingError(f"{name} must have the shape ({wanted}), and has {array.shape}.")
    if array.dtype.kind not in ("iu" if kind is np.int64 else "fiu"):
        raise RecordingError(
            f"{name} must hold {'whole ' if kind is np.int64 else ''}numbers, and holds {array.dtype}."
        )
    return array.astype(kind)


def finite(name: str, array: np.ndarray) -> np.ndarray:
    """The array unchanged. Raises RecordingError where a number of it is NaN or infinite."""
    bad = ~np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    if bad.any():
        raise RecordingError(f"{name}[{np.argmax(bad)}] is not finite; leave out what was not measured.")
    return array


def offsets(name: str, arrays: Mapping[str, np.ndarray], points: int, clouds: int | None) -> Int64[np.ndarray, " L"]:
    """Offsets of the clouds. Raises RecordingError where they do not partition the points."""
    ends = as_array(name, arrays, (None if clouds is None else clouds + 1,), np.int64)
    if not len(ends) or ends[0] != 0:
        raise RecordingError(f"{name}[0] must be 0: the first cloud begins with the first point.")
    back = np.diff(ends) < 0
    if back.any():
        raise RecordingError(f"{name}[{np.argmax(back) + 1}] is less than the one before.")
    if ends[-1] != points:
        raise RecordingError(f"{name}[{len(ends) - 1}] must be {points}, the number of points, and is {ends[-1]}.")
    return ends


def forward(name: str, times: Float64[np.ndarray, " T"], of_episodes: str, episode: Int64[np.ndarray, " T"]) -> None:
    """Raises RecordingError where a time does not increase within its episode, or cannot be in seconds."""
    back = np.diff(episode) < 0
    if back.any():
        raise RecordingError(f"{of_episodes}[{np.argmax(back) + 1}] goes back; give the episodes one after another.")
    back = (np.diff(times) <= 0) & (np.diff(episode) == 0)
    if back.any():
        index = int(np.argmax(back)) + 1
        raise RecordingError(
            f"{name}[{index}] = {times[index]:g} s is not after the one before; times increase within an episode."
        )
    far = (times < _EARLIEST_S) | (times > _LATEST_S)
    if far.any():
        index = int(np.argmax(far))
        raise RecordingError(f"{name}[{index}] = {times[index]:g} cannot be seconds on a clock; give times in seconds.")


def plausible_cloud(clouds: Sequence[Float32[np.ndarray, "_ 3"]], about: Mapping[str, Any]) -> None:
    """Raises RecordingError where an object has too few points, or is too large or far away for metres."""
    length_m, first = _number(about, "object", "length_m"), 0
    for index, cloud in enumerate(clouds):
        if len(cloud) < _FEWEST_POINTS:
            raise RecordingError(
                f"cloud_offsets[{index + 1}] gives cloud {index} {len(cloud)} points; "
                f"at least {_FEWEST_POINTS} are needed."
            )
        far = np.linalg.norm(cloud, axis=1) > _FARTHEST_M
        if far.any():
            at = int(np.argmax(far))
            raise RecordingError(
                f"cloud_points[{first + at}] lies {np.linalg.norm(cloud[at]):.4g} m from the base; give metres in the "
                "base frame."
            )
        across = float(np.linalg.norm(np.ptp(cloud, axis=0)))
        if across < _POINT_M:
            raise RecordingError(
                f"cloud_points[{first}] and those after it, cloud {index}, are all at one place; give the points of "
                "the whole object."
            )
        if length_m is not None and across > _COILED * length_m:
            raise RecordingError(
                f"cloud_points[{first}] and those after it, cloud {index}, are {across:.3g} m across; about says that "
                f"the object is {length_m:g} m long."
            )
        first += len(cloud)


def plausible_poses(
    name: str, times: Float64[np.ndarray, " T"], poses: Poses, episode: Int64[np.ndarray, " T"]
) -> None:
    """Raises RecordingError where a pose is out of reach, too fast, or turned by no unit quaternion."""
    far = np.linalg.norm(poses[:, :3], axis=1) > _FARTHEST_M
    if far.any():
        index = int(np.argmax(far))
        raise RecordingError(
            f"{name}[{index}] lies {np.linalg.norm(poses[index, :3]):.4g} m from the base; give metres."
        )
    bad = np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1) > _UNIT_TOLERANCE
    if bad.any():
        index = int(np.argmax(bad))
        raise RecordingError(
            f"{name}[{index}] has a quaternion w x y z of the length {np.linalg.norm(poses[index, 3:]):.4g}, not 1."
        )
    steps, same = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1), np.diff(episode) == 0
    fast = same & (steps > _FASTEST_M_S * np.where(same, np.diff(times), 1.0))
    if fast.any():
        index = int(np.argmax(fast)) + 1
        later_s = times[index] - times[index - 1]
        raise RecordingError(
            f"{name}[{index}] lies {steps[index - 1]:.3g} m from the one before, {later_s:.3g} s "
            "later: no arm is as fast; give metres and seconds."
        )


def plausible_about(about: Mapping[str, Any]) -> None:
    """Raises RecordingError where a size is implausible for an object on a table."""
    mass = _number(about, "object", "mass_kg")
    if mass is not None and not 0 < mass <= _HEAVIEST_KG:
        raise RecordingError(f"about says that object.mass_kg is {mass:g}; give kilograms, or leave it out.")
    yaw = _number(about, "tool", "yaw_rad")
    if yaw is not None and not abs(yaw) <= _MOST_YAW_RAD:
        raise RecordingError(f"about says that tool.yaw_rad is {yaw:g}; give radians from -pi to pi, or leave it out.")
    _plausible_shape(about)
    for thing, name in _SIZES:
        size = _number(about, thing, name)
        round_ = name == "half_width_m" and size == 0
        if size is not None and not round_ and not 0 < size <= _FARTHEST_M:
            raise RecordingError(f"about says that {thing}.{name} is {size:g}; give metres, or leave it out.")


def half_sides(about: Mapping[str, Any]) -> tuple[float, float] | None:
    """Half sides of a box-shaped tool along its own x and y axes [m], None where it is no box.

    Raises RecordingError where they are no lengths.
    """
    of: Any = about.get("tool", {})
    value: Any = of.get("half_m") if isinstance(of, Mapping) else None
    if value is None:
        return None
    numbers = isinstance(value, list) and all(isinstance(it, int | float) and 0 < it <= _FARTHEST_M for it in value)
    if not numbers or len(value) not in (2, 3):
        raise RecordingError(
            f"about says that tool.half_m is {value!r}; give half of its sides along its x, y (and z) axes in metres, "
            "for example [0.018, 0.006]."
        )
    return float(value[0]), float(value[1])


def _plausible_shape(about: Mapping[str, Any]) -> None:
    of: Any = about.get("tool", {})
    shape: Any = of.get("shape") if isinstance(of, Mapping) else None
    if shape not in (None, *_SHAPES):
        raise RecordingError(f"about says that tool.shape is {shape!r}; known are {', '.join(_SHAPES)}.")
    if half_sides(about) is not None and shape == "cylinder":
        raise RecordingError("about gives half_m, sides of a box, of a tool whose shape is 'cylinder'; give radius_m.")


def whole_pushes(
    times: Float64[np.ndarray, " K"],
    episode: Int64[np.ndarray, " K"],
    push: Int64[np.ndarray, " K"],
    phases: Sequence[str],
    command_times: Mapping[int, Float64[np.ndarray, " _"]],
) -> dict[int, list[list[int]]]:
    """Indices of the clouds of each push of each episode.

    Raises RecordingError where a push is not one cloud before it, some during it and one after it, where it lasts too
    long, or where it has no command.
    """
    groups: dict[int, dict[int, list[int]]] = {}
    for index, (number, own) in enumerate(zip(episode.tolist(), push.tolist(), strict=True)):
        pushes = groups.setdefault(number, {})
        if own in pushes and next(reversed(pushes)) != own:
            raise RecordingError(f"cloud_push[{index}] goes back to push {own}; give the pushes one after another.")
        pushes.setdefault(own, []).append(index)
    for number, pushes in groups.items():
        for own, members in pushes.items():
            _whole_push(f"episode {number}, push {own}", members, times, phases)
            first, last = members[0], members[-1]
            commands = command_times.get(number, np.zeros(0))
            if np.sum((commands >= times[first]) & (commands <= times[last])) < 2:
                raise RecordingError(
                    f"command_time has not two values from cloud_time[{first}] = {times[first]:g} s to "
                    f"cloud_time[{last}] = {times[last]:g} s (episode {number}, push {own}); give the commanded poses "
                    "of every push."
                )
    if not groups:
        raise RecordingError("cloud_time is empty; there is nothing to import.")
    return {number: list(pushes.values()) for number, pushes in groups.items()}


def _whole_push(name: str, members: Sequence[int], times: Float64[np.ndarray, " K"], phases: Sequence[str]) -> None:
    first, last = members[0], members[-1]
    if phases[first] != "before":
        raise RecordingError(f"cloud_phase[{first}] must be 'before': {name} begins there.")
    if phases[last] != "after" or first == last:
        raise RecordingError(f"cloud_phase[{last}] must be 'after': {name} ends there.")
    for index in members[1:-1]:
        if phases[index] != "during":
            raise RecordingError(f"cloud_phase[{index}] must be 'during': it stands amid {name}.")
    lasts_s = times[last] - times[first]
    if lasts_s > _LONGEST_PUSH_S:
        raise RecordingError(
            f"cloud_time[{last}] is {lasts_s:g} s after cloud_time[{first}], the beginning of {name}; give seconds."
        )


def _number(about: Mapping[str, Any], thing: str, name: str) -> float | None:
    """A number in `about`, None where it is left out. Raises RecordingError where it is not a number."""
    of = about.get(thing, {})
    if not isinstance(of, Mapping):
        raise RecordingError(f'about.{thing} must be a JSON object, for example {{"{name}": 0.008}}.')
    value: Any = of.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RecordingError(f"about says that {thing}.{name} is {value!r}; give a number of metres.")
    return float(max(-_LARGEST, min(value, _LARGEST)))  # A whole number may have any number of digits.
