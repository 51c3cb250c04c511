"""Set-up of recordings that are to be one collection, and in what another one differs, in words."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from pathlib import Path
from typing import Any, Final, Self, final

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.colours import ColourRange
from app.core.errors import RecordingError, UsageError
from app.core.geometry.camera import CameraModel
from app.core.geometry.object_description import ObjectDescription, recorded_object
from app.core.messages import Episode, Parameter
from app.core.task_name import TaskName, recorded_name
from app.recording.read.reader import read_cameras, read_episode

_MOVED_M: Final = 2e-3
_TURNED_DEG: Final = 0.3
"""A camera that stands as far elsewhere was moved: calibrating it twice differs by a third of that."""
_OTHER_LENS: Final = 3e-3
"""Relative difference of focal lengths, or of the image's middle by its width, of another lens or image size."""
_MM: Final = 1e3
_KEYS: Final = {"preset": "preset", "world": "world of the simulated rope", "table": "pose of the table"}
"""Further keys of the configuration of an episode, and their names."""
COLLECTED: Final = "collected"
"""Key of the options of a collection in the configuration of a recording's `Episode`."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CollectionSetup:
    """Task, object, cell and cameras; `said`: further settings by their names, as far as they are known.

    `cameras` None: nothing was seen by cameras.
    """

    task: str
    rig: str
    description: ObjectDescription | None = None
    cameras: tuple[CameraModel, ...] | None = None
    said: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @classmethod
    def of_recording(cls, path: Path) -> Self:
        """That of a recording. Raises as `read_episode`."""
        episode = read_episode(path)
        return cls.of_episode(episode, tuple(read_cameras(path)) or None)

    @classmethod
    def of_episode(cls, episode: Episode, cameras: tuple[CameraModel, ...] | None) -> Self:
        """That of an episode which these cameras see."""
        config = _config(episode)
        options, collected = (_sub(config, name) for name in ("options", COLLECTED))
        # What was asked for may be "auto"; what it came to stands beside it.
        known = {**options, **config}
        said = {name: known[key] for key, name in _KEYS.items() if key in known}
        limits = _sub(config, "limits")
        if "workspace" in limits:
            said["workspace"] = limits["workspace"]
        return cls(
            task=recorded_name(episode.task),
            rig=episode.rig,
            description=recorded_object(episode.config),
            cameras=cameras,
            said=said | dict(collected),
        )


def require_same(before: CollectionSetup, now: CollectionSetup, of: Path) -> None:
    """Raises UsageError, which names each difference, where this is another set-up than that of the recording `of`."""
    if found := list(differences(before, now)):
        raise UsageError(
            f"This is not the set-up of {of}: {'; '.join(found)}. Set it up as it was, or begin another collection."
        )


def differences(before: CollectionSetup, now: CollectionSetup) -> Iterator[str]:
    """Clauses on what differs; what one of both does not say is not compared."""
    if before.task != now.task:
        yield f"the task was {before.task}, and is {now.task}"
    if before.rig != now.rig:
        yield f"the cell was {before.rig}, and is {now.rig}"
    yield from _of_object(before.description, now.description)
    for name, was in before.said.items():
        if name in now.said and _plain(was) != _plain(now.said[name]):
            yield f"the {name} was {_text(was)}, and is {_text(now.said[name])}"
    if before.cameras is not None and now.cameras is not None:
        yield from _of_cameras(before.cameras, now.cameras)


def _of_object(before: ObjectDescription | None, now: ObjectDescription | None) -> Iterator[str]:
    if before is None or now is None:
        if before is not now:
            yield f"the object was {_called(before)}, and is {_called(now)}"
        return
    for name in ("kind", "name", "colour", "seen_colours", "priors"):
        old, new = getattr(before, name), getattr(now, name)
        if _plain(old) != _plain(new):
            name = {"seen_colours": "range of colours"}.get(name, name)
            yield f"the object's {name} was {_text(old)}, and is {_text(new)}"
    for name in sorted({*before.sizes, *now.sizes}):
        old, new = before.sizes.get(name), now.sizes.get(name)
        if old is None or new is None or not np.isclose(old, new, rtol=1e-6, atol=0.0):
            yield f"the object's {name} was {_text(old)}, and is {_text(new)}"


def _called(description: ObjectDescription | None) -> str:
    if description is None:
        return "the task's"
    return repr(description.name) if description.name else f"a described {description.kind or 'one'}"


def _of_cameras(before: Sequence[CameraModel], now: Sequence[CameraModel]) -> Iterator[str]:
    old, new = ({camera.name: camera for camera in cameras} for cameras in (before, now))
    if gone := sorted(set(old) - set(new)):
        yield f"camera {', '.join(map(repr, gone))} is missing"
    if added := sorted(set(new) - set(old)):
        yield f"camera {', '.join(map(repr, added))} was not there"
    for name in sorted(set(old) & set(new)):
        yield from _of_camera(old[name], new[name])


def _of_camera(before: CameraModel, now: CameraModel) -> Iterator[str]:
    if (before.width, before.height) != (now.width, now.height):
        yield f"camera {now.name!r} had {before.width} x {before.height} pixels, and has {now.width} x {now.height}"
        return
    if not all(np.isfinite(each.T_world_camera).all() and np.isfinite(each.K).all() for each in (before, now)):
        yield f"nobody knows where camera {now.name!r} stands or stood: its calibration is not finite"
        return
    lens = np.abs(before.K - now.K).max() / before.width
    if not lens <= _OTHER_LENS:
        yield f"the lens of camera {now.name!r} is calibrated otherwise, by {1e2 * lens:.1f} % of the image's width"
    moved_m = float(np.linalg.norm(before.T_world_camera[:3, 3] - now.T_world_camera[:3, 3]))
    turned = Rotation.from_matrix(before.T_world_camera[:3, :3]).inv() * Rotation.from_matrix(
        now.T_world_camera[:3, :3]
    )
    turned_deg = degrees(float(turned.magnitude()))
    if not (moved_m <= _MOVED_M and turned_deg <= _TURNED_DEG):
        yield f"camera {now.name!r} stands {_MM * moved_m:.0f} mm elsewhere, turned by {turned_deg:.1f} degrees"


def _config(episode: Episode) -> Mapping[str, Any]:
    try:
        found: Any = json.loads(episode.config)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _sub(config: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = config.get(name)
    return found if isinstance(found, dict) else {}


def _plain(value: object) -> object:
    """The value as JSON has it, so that tuples and lists are the same."""
    return json.loads(json.dumps(value, default=vars))


def _text(value: object) -> str:
    match value:
        case None | () | "":
            return "the task's"
        case ColourRange():
            return f"hue {value.hue_low_deg:.0f} to {value.hue_high_deg:.0f} degrees"
        case float() | int():
            return f"{value:.4g}"
        case (Parameter(), *_):
            return ", ".join(f"{each.name} {each.low:.4g} to {each.high:.4g}" for each in value)
        case (float() | int(), *_):
            return f"({', '.join(map(_text, value))})"
        case _:
            return json.dumps(_plain(value))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EarlierCollection:
    """The recordings of a collection that can be gone on from, and their common set-up.

    `skipped`: a sentence on each recording of the folder that is none of them.
    """

    paths: tuple[Path, ...]
    setup: CollectionSetup
    skipped: tuple[str, ...] = ()


def earlier_collection(folder: Path, task: str) -> EarlierCollection:
    """The collection in the folder, or of the one file, as far as it is of the problem of `task`, whatever its sizes.

    Recordings of other problems are left out, and those that cannot be read: cut off, or still being written. Raises
    UsageError where none is left, and RecordingError where two are of two set-ups already, or the one file cannot be
    read.
    """
    if not folder.is_dir():
        return EarlierCollection(paths=(folder,), setup=CollectionSetup.of_recording(folder))
    found, skipped, problem = dict[Path, CollectionSetup](), list[str](), TaskName.parse(task).problem
    for path in sorted(folder.glob("*.mcap")):
        try:
            setup = CollectionSetup.of_recording(path)
        except (RecordingError, UsageError) as error:
            skipped.append(f"Left out: {error}")
            continue
        if TaskName.parse(setup.task).problem == problem:
            found[path] = setup
        else:
            skipped.append(f"Left out: {path} is of {setup.task}.")
    if not found:
        none = f"{folder} holds no recording of {problem} to go on from; leave --resume out to begin a collection."
        raise UsageError(" ".join([none, *skipped[:1]]))
    return EarlierCollection(paths=tuple(found), setup=_common_setup(found), skipped=tuple(skipped))


def _common_setup(setups: Mapping[Path, CollectionSetup]) -> CollectionSetup:
    """The set-up of all these recordings. Raises RecordingError, which names two that differ."""
    (begun, first), *others = setups.items()
    for path, other in others:
        if found := list(differences(first, other)):
            raise RecordingError(f"{begun} and {path} are of two set-ups already: {'; '.join(found)}.")
    return first
