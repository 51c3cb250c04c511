"""One recording as evenly sampled steps: tool pose, images, object and goal, and the next commanded tool pose."""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.errors import RecordingError
from app.core.geometry.track import poses_at
from app.core.messages import Episode, Executed, Goal, Particles
from app.recording.read.reader import Picture, read_messages, read_pictures

STATE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "opening")
"""Components of a tool state: position [m], quaternion, and opening [m]."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """The steps of one episode: `state (S, 8)`, `action (S, 8)`, `object (S, N, 3)` and `goal (S, M, 3)` [m].

    `pictures`: each camera's newest image at each step, as stored in the recording.
    """

    episode: Episode
    state: Float32[np.ndarray, "S 8"]
    action: Float32[np.ndarray, "S 8"]
    object: Float32[np.ndarray, "S N 3"]
    goal: Float32[np.ndarray, "S M 3"]
    pictures: Mapping[str, Sequence[Picture]]

    def __len__(self) -> int:
        return len(self.state)


def sample(path: Path, fps: int) -> Samples:
    """The actions in the recording, `fps` steps a second.

    Raises RecordingError where it holds no action, or no observation before the first; and as `read_messages`.
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
    steps = [_along(executed, fps) for executed in made]
    times = np.concatenate([step.times_s for step in steps])
    newest = _newest([particles.time_s for particles in seen], times, path)
    return Samples(
        episode=episode,
        state=np.concatenate([step.state for step in steps]).astype(np.float32),
        action=np.concatenate([step.action for step in steps]).astype(np.float32),
        object=_alike([seen[index].positions for index in newest], path),
        goal=_alike([goals[index].positions for index in _goal_indices(goals, times)], path),
        pictures={name: _pictures(of_one, times, path) for name, of_one in _by_camera(path).items()},
    )


class _Steps(NamedTuple):
    """Steps of one action: times, tool states, and the tool state commanded for the next step."""

    times_s: Float64[np.ndarray, " S"]
    state: Float64[np.ndarray, "S 8"]
    action: Float64[np.ndarray, "S 8"]


def _along(executed: Executed, fps: int) -> _Steps:
    times_s, tool = executed.times_s, executed.tool
    told = np.concatenate([executed.commanded, tool[:, 7:]], axis=1)
    at = np.arange(times_s[0], times_s[-1], 1 / fps)
    return _Steps(at, poses_at(at, times_s, tool), poses_at(at + 1 / fps, times_s, told))


def _newest(dated_s: Sequence[float], at_s: np.ndarray, path: Path) -> Sequence[int]:
    """Index of the newest of `dated_s` at each moment; the first must precede the first action."""
    found = [bisect_right(dated_s, moment) - 1 for moment in at_s]
    if min(found) < 0:
        raise RecordingError(f"{path}: nothing was seen before its first action; leave it out.")
    return found


def _goal_indices(goals: Sequence[Goal], at_s: np.ndarray) -> Sequence[int]:
    """Index of the goal at each moment; the first goal for moments before it."""
    dated_s = [goal.time_s for goal in goals]
    return [max(bisect_right(dated_s, moment) - 1, 0) for moment in at_s]


def _alike(clouds: Sequence[Float32[np.ndarray, "_ 3"]], path: Path) -> Float32[np.ndarray, "S N 3"]:
    if len({cloud.shape for cloud in clouds}) > 1:
        raise RecordingError(f"{path}: its object or goal does not always have as many particles; leave it out.")
    return np.stack(clouds)


def _by_camera(path: Path) -> dict[str, list[Picture]]:
    found: dict[str, list[Picture]] = {}
    for picture in read_pictures(path):
        found.setdefault(picture.camera, []).append(picture)
    return found


def _pictures(of_one: Sequence[Picture], at_s: np.ndarray, path: Path) -> Sequence[Picture]:
    return [of_one[index] for index in _newest([picture.time_s for picture in of_one], at_s, path)]


def read_samples(paths: Sequence[Path], fps: int) -> Iterator[tuple[Path, Samples]]:
    """Samples of each recording, all of one kind. Raises RecordingError, naming a file that differs from the first."""
    first: tuple[object, ...] | None = None
    for path in paths:
        samples = sample(path, fps)
        kind = _kind(samples)
        if first is not None and kind != first:
            raise RecordingError(
                f"{path} is unlike {paths[0]}: rig, cameras with their image sizes, particles of object and goal are "
                f"{kind} here and {first} there; export them apart."
            )
        first = kind
        yield path, samples


def _kind(samples: Samples) -> tuple[object, ...]:
    cameras = {name: (of_one[0].width, of_one[0].height) for name, of_one in sorted(samples.pictures.items())}
    return samples.episode.rig, cameras, samples.object.shape[1], samples.goal.shape[1]
