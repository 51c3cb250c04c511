"""Frames and the transforms between them over time, as ROS publishes them on /tf and /tf_static."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError
from app.core.geometry.track import poses_at
from app.core.types import Poses, Transform

_STALE_S: Final = 1.0
"""Time before the first and after the last transform for which that holds."""
_DEEPEST: Final = 100
IDENTITY: Final = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@final
@dataclass(kw_only=True, eq=False)
class _Edge:
    """Transforms from a child frame to its parent. A static one has no times."""

    parent: str
    times_s: list[float] = field(default_factory=list[float])
    poses: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    static: bool = False

    def at(self, times_s: Float64[np.ndarray, " T"]) -> Poses:
        poses = np.array(self.poses)
        if self.static or len(poses) == 1:
            return np.repeat(poses[-1:], len(times_s), axis=0)
        times, first = np.unique(self.times_s, return_index=True)
        return poses_at(times_s, times, poses[first])


@final
class TransformTree:
    """Frames of a recording. Poses are x y z [m] and a quaternion w x y z."""

    def __init__(self) -> None:
        self._edges = dict[str, _Edge]()

    def add(self, parent: str, child: str, pose: tuple[float, ...], time_s: float | None = None) -> None:
        """Add `T_parent_child` at a time; None: at all times."""
        parent, child = parent.lstrip("/"), child.lstrip("/")
        edge = self._edges.get(child)
        if edge is None or edge.parent != parent or time_s is None:
            edge = self._edges[child] = _Edge(parent=parent, static=time_s is None)
        edge.times_s.append(0.0 if time_s is None else time_s)
        edge.poses.append(pose)

    @property
    def frames(self) -> frozenset[str]:
        """Names of all frames."""
        return frozenset({*self._edges, *(edge.parent for edge in self._edges.values())})

    def parents(self, frame: str) -> Iterator[str]:
        """The frame, its parent, and so on to the root."""
        for _ in range(_DEEPEST):
            yield frame
            if frame not in self._edges:
                return
            frame = self._edges[frame].parent
        raise RecordingError(f"The transforms above {frame!r} form a circle; leave one of them out of /tf.")

    def moves(self, frame: str, base: str) -> bool:
        """True where the frame is below `base` and moves against it."""
        chain = list(self.parents(frame))
        return base in chain and any(not self._edges[it].static for it in chain[: chain.index(base)])

    def leaves(self) -> list[str]:
        """Frames without children."""
        parents = {edge.parent for edge in self._edges.values()}
        return sorted(frame for frame in self._edges if frame not in parents)

    def times_s(self, base: str, frame: str) -> Float64[np.ndarray, " T"]:
        """Times at which any transform between the two was given."""
        edges = [edge for edge in self._chain(base, frame) if not edge.static]
        return np.unique(np.concatenate([np.zeros(0), *(np.array(edge.times_s) for edge in edges)]))

    def poses(self, base: str, frame: str, times_s: Float64[np.ndarray, " T"]) -> Poses:
        """`T_base_frame` at times, straight between those given.

        Raises RecordingError where the frames are not connected, or nothing was published within a second of a time.
        """
        up, down = self._path(frame.lstrip("/"), base.lstrip("/"))
        for name in (*up, *down):
            self._require_fresh(name, times_s)
        of_frame, of_base = (self._compose(names, times_s) for names in (up, down))
        return compose(inverse(of_base), of_frame)

    def at(self, base: str, frame: str, time_s: float) -> Transform:
        """`T_base_frame` at a time; raises as `poses`."""
        return matrix(self.poses(base, frame, np.array([time_s]))[0])

    def _compose(self, names: list[str], times_s: Float64[np.ndarray, " T"]) -> Poses:
        """Pose of the first of the frames in the parent of the last."""
        pose = np.repeat(np.array([IDENTITY]), len(times_s), axis=0)
        for name in names:
            pose = compose(self._edges[name].at(times_s), pose)
        return pose

    def _require_fresh(self, name: str, times_s: Float64[np.ndarray, " T"]) -> None:
        edge = self._edges[name]
        if edge.static or not len(times_s):
            return
        first, last = min(edge.times_s) - _STALE_S, max(edge.times_s) + _STALE_S
        if times_s.min() < first or times_s.max() > last:
            raise RecordingError(
                f"The transform of {name!r} to {edge.parent!r} is known from {first + _STALE_S:.3f} to "
                f"{last - _STALE_S:.3f} s, and is asked for at {times_s.min():.3f} to {times_s.max():.3f} s; record "
                '/tf as long as the rest, or take clock = "receive" in the file of --topics.'
            )

    def _path(self, frame: str, base: str) -> tuple[list[str], list[str]]:
        """Edges from `frame` up to the nearest common ancestor, and those from `base`."""
        above, below = list(self.parents(frame)), list(self.parents(base))
        common = next((name for name in above if name in below), None)
        if common is None or (frame != base and not {frame, base} <= self.frames):
            known = ", ".join(sorted(self.frames)) or "none"
            raise RecordingError(
                f"The frames {base!r} and {frame!r} are not connected by /tf or /tf_static (frames: {known}); name "
                "others in the file of --topics, or give the pose there."
            )
        return above[: above.index(common)], below[: below.index(common)]

    def _chain(self, base: str, frame: str) -> list[_Edge]:
        up, down = self._path(frame.lstrip("/"), base.lstrip("/"))
        return [self._edges[name] for name in (*up, *down)]

    @property
    def roots(self) -> Mapping[str, int]:
        """Frames without a parent, with the number of frames below each."""
        counts = dict[str, int]()
        for frame in self._edges:
            root = list(self.parents(frame))[-1]
            counts[root] = counts.get(root, 0) + 1
        return counts


def compose(outer: Poses, inner: Poses) -> Poses:
    """`T_a_c` of `T_a_b` and `T_b_c`, row by row."""
    turn = Rotation.from_quat(outer[:, 3:], scalar_first=True)
    place = outer[:, :3] + turn.apply(inner[:, :3])
    turned = (turn * Rotation.from_quat(inner[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
    return np.concatenate([place, turned], axis=1)


def inverse(poses: Poses) -> Poses:
    """`T_b_a` of `T_a_b`, row by row."""
    turn = Rotation.from_quat(poses[:, 3:], scalar_first=True).inv()
    return np.concatenate([-turn.apply(poses[:, :3]), turn.as_quat(scalar_first=True)], axis=1)


def matrix(pose: Float64[np.ndarray, "7"] | tuple[float, ...]) -> Transform:
    """The pose as a matrix."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(np.asarray(pose)[3:], scalar_first=True).as_matrix()
    T[:3, 3] = np.asarray(pose)[:3]
    return T
