"""One recording as evenly sampled steps: tool pose, images, object and goal, and the next commanded tool pose."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.errors import RecordingError
from app.core.geometry.camera import CameraModel
from app.core.geometry.track import poses_at
from app.core.messages import Episode, Executed, Goal, Particles
from app.recording.exchange.lerobot.depth_image import DepthUnit, depth_pixels, depth_tiff, depth_unit, with_one_unit
from app.recording.read.reader import Picture, read_frame_times, read_messages, read_pictures

STATE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "opening")
"""Components of a tool state: position [m], quaternion, and opening [m]."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CameraImages:
    """The newest images of one camera at each step: `jpeg`, and `depth` as TIFF files, all of `depth_unit`.

    `depth` is empty where none of them has a reading. `camera`: its place and optics, None where they change.
    """

    size: tuple[int, int]
    jpeg: Sequence[bytes]
    depth: Sequence[bytes]
    depth_unit: DepthUnit
    camera: CameraModel | None

    def without_files(self) -> "CameraImages":
        """The camera alone, which takes little memory; `depth` still says whether there is any."""
        return replace(self, jpeg=(), depth=self.depth[:1])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """The steps of one episode: `state (S, 8)`, `action (S, 8)`, `object (S, N, 3)` and `goal (S, M, 3)` [m]."""

    episode: Episode
    state: Float32[np.ndarray, "S 8"]
    action: Float32[np.ndarray, "S 8"]
    object: Float32[np.ndarray, "S N 3"]
    goal: Float32[np.ndarray, "S M 3"]
    images: Mapping[str, CameraImages]

    def __len__(self) -> int:
        return len(self.state)


def sample(path: Path, fps: int, rest_s: float = 0.0) -> Samples:
    """The actions in the recording, `fps` steps a second, and `rest_s` of rest after each.

    The steps of a rest show what was seen first after the action. Raises RecordingError where the recording holds no
    action, or no observation before the first; and as `read_messages`.
    """
    said = list(read_messages(path, [Episode, Goal, Particles, Executed]))
    episode = next((message for message in said if isinstance(message, Episode)), None)
    goals = [message for message in said if isinstance(message, Goal)]
    seen = [message for message in said if isinstance(message, Particles)]
    made = [message for message in said if isinstance(message, Executed) and len(message.times_s) > 1]
    if episode is None or not goals or not made or not seen:
        raise RecordingError(
            f"{path} holds no goal, object or action; a demonstration has all three. Leave it out, or record one with "
            "`dipac collect`."
        )
    looked = [particles.time_s for particles in seen]
    views = [looked, *read_frame_times(path).values()] if rest_s > 0 else []
    steps = [
        _along(executed, fps, _rest_of(executed, made[at + 1 :], views, rest_s)) for at, executed in enumerate(made)
    ]
    times = np.concatenate([step.times_s for step in steps])
    newest = _newest(looked, times, path)
    return Samples(
        episode=episode,
        state=np.concatenate([step.state for step in steps]).astype(np.float32),
        action=np.concatenate([step.action for step in steps]).astype(np.float32),
        object=_alike([seen[index].positions for index in newest], path),
        goal=_alike([goals[index].positions for index in _goal_indices(goals, times)], path),
        images=_images(path, times),
    )


class _Steps(NamedTuple):
    """Steps of one action: times, tool states, and the tool state commanded for the next step."""

    times_s: Float64[np.ndarray, " S"]
    state: Float64[np.ndarray, "S 8"]
    action: Float64[np.ndarray, "S 8"]


class _Rest(NamedTuple):
    """Beginning and end of a rest [s]."""

    first_s: float
    last_s: float


def _rest_of(made: Executed, later: Sequence[Executed], views: Sequence[Sequence[float]], rest_s: float) -> _Rest:
    """Rest after an action, from the first moment at which all `views` show what came of it to the next action."""
    end_s = float(made.times_s[-1])
    until_s = float(later[0].times_s[0]) if later else math.inf
    first = [bisect_left(dated_s, end_s) for dated_s in views]
    if not views or any(at == len(dated_s) for at, dated_s in zip(first, views, strict=True)):
        return _Rest(end_s, end_s)
    seen_s = max(dated_s[at] for at, dated_s in zip(first, views, strict=True))
    return _Rest(seen_s, max(min(seen_s + rest_s, until_s), seen_s))


def _along(executed: Executed, fps: int, rest: _Rest) -> _Steps:
    times_s, tool = executed.times_s, executed.tool
    told = np.concatenate([executed.commanded, tool[:, 7:]], axis=1)
    moving = np.arange(times_s[0], times_s[-1], 1 / fps)
    resting = rest.first_s + np.arange(round((rest.last_s - rest.first_s) * fps)) / fps
    at = np.concatenate([moving, resting])
    return _Steps(at, poses_at(at, times_s, tool), poses_at(at + 1 / fps, times_s, told))


def _newest(dated_s: Sequence[float], at_s: np.ndarray, path: Path) -> Sequence[int]:
    """Index of the newest of `dated_s` at each moment; the first must precede the first action."""
    found = [bisect_right(dated_s, moment) - 1 for moment in at_s]
    if min(found) < 0:
        raise _unseen(path)
    return found


def _unseen(path: Path) -> RecordingError:
    return RecordingError(f"{path}: nothing was seen before its first action; leave it out.")


def _goal_indices(goals: Sequence[Goal], at_s: np.ndarray) -> Sequence[int]:
    """Index of the goal at each moment; the first goal for moments before it."""
    dated_s = [goal.time_s for goal in goals]
    return [max(bisect_right(dated_s, moment) - 1, 0) for moment in at_s]


def _alike(clouds: Sequence[Float32[np.ndarray, "_ 3"]], path: Path) -> Float32[np.ndarray, "S N 3"]:
    if len({cloud.shape for cloud in clouds}) > 1:
        raise RecordingError(f"{path}: its object or goal does not always have as many particles; leave it out.")
    return np.stack(clouds)


def _images(path: Path, at_s: Float64[np.ndarray, " S"]) -> dict[str, CameraImages]:
    """The newest images of each camera at each moment. Raises RecordingError where a camera has none before the first.

    One pass over the file, which keeps of its images only those that are the newest at some moment.
    """
    found: dict[str, _NewestImages] = {}
    for picture in read_pictures(path):
        found.setdefault(picture.camera.name, _NewestImages(path, at_s)).add(picture)
    return {name: newest.images() for name, newest in found.items()}


@dataclass(eq=False)
class _NewestImages:
    """Images of one camera in the order of their exposures, until each moment has its newest one."""

    path: Path
    at_s: Float64[np.ndarray, " S"]
    newest: Picture | None = None
    cameras: list[CameraModel] = field(default_factory=list[CameraModel])
    jpeg: list[bytes] = field(default_factory=list[bytes])
    depth: list[bytes] = field(default_factory=list[bytes])
    has_depth: bool = False

    def add(self, picture: Picture) -> None:
        self._fill(picture.time_s)
        self.newest = picture

    def images(self) -> CameraImages:
        """All of them, when no image is left to add."""
        self._fill(math.inf)
        first = self.cameras[0]
        unit: DepthUnit = "mm" if all(depth_unit(camera) == "mm" for camera in self.cameras) else "m"
        return CameraImages(
            size=(first.height, first.width),
            jpeg=self.jpeg,
            depth=with_one_unit(self.depth, unit) if self.has_depth else [],
            depth_unit=unit,
            camera=first if all(is_same_camera(first, other) for other in self.cameras) else None,
        )

    def _fill(self, until_s: float) -> None:
        """Give the newest image to the moments before `until_s` that have none."""
        count = int(np.searchsorted(self.at_s, until_s)) - len(self.jpeg)
        if count <= 0:
            return
        if self.newest is None:
            raise _unseen(self.path)
        camera = self.newest.camera
        steps = depth_pixels(camera, self.newest.depth)
        self.has_depth |= bool(steps.any())
        self.cameras.append(camera)
        self.jpeg += [self.newest.jpeg] * count
        self.depth += [depth_tiff(camera, steps)] * count


def is_same_camera(one: CameraModel, other: CameraModel) -> bool:
    """True for cameras of one place and optics, but for what a file of decimal numbers rounds."""
    return bool(
        (one.name, one.width, one.height) == (other.name, other.width, other.height)
        and np.allclose(one.K, other.K, atol=1e-6)
        and np.allclose(one.T_world_camera, other.T_world_camera, atol=1e-9)
    )


def read_samples(paths: Sequence[Path], fps: int, rest_s: float) -> Iterator[tuple[Path, Samples]]:
    """Samples of each recording, all of one kind. Raises RecordingError, naming a file that differs from the first."""
    first: tuple[object, ...] | None = None
    for path in paths:
        samples = sample(path, fps, rest_s)
        kind = _kind(samples)
        if first is not None and kind != first:
            raise RecordingError(
                f"{path} is unlike {paths[0]}: rig, cameras with their image sizes and units of depth, particles of "
                f"object and goal are {kind} here and {first} there; export them apart."
            )
        first = kind
        yield path, samples


def _kind(samples: Samples) -> tuple[object, ...]:
    cameras = {
        name: (*it.size[::-1], it.depth_unit if it.depth else "no depth") for name, it in sorted(samples.images.items())
    }
    return samples.episode.rig, cameras, samples.object.shape[1], samples.goal.shape[1]
