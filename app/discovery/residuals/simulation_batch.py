"""Pushes made ready for simulation, with what was observed of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.bowls import PouredBowls
from app.discovery.dataset.held_part import with_held_parts
from app.discovery.dataset.labels import label_of, label_particles, no_labels
from app.discovery.dataset.model_under_test import Subject
from app.discovery.dataset.object_kinds import ROPE, ObjectTraits
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.centreline_gap import centreline_gap, gap_of_displaced
from app.discovery.residuals.centreline_noise import smooth_noise
from app.discovery.residuals.displacement_field import MODES, PIECE_MODES, REVERSED, SHEET_MODES, Basis, register
from app.discovery.residuals.poured_contents import CONTENTS, contents_m
from app.discovery.residuals.tool_load import dragging
from app.discovery.sensor_actuator_errors.base import Load
from app.sim.rods.geometry.rope_cloud import RopeShape
from app.sim.rods.state import RodStart

_LEAD_S, _TAIL_S = 0.05, 0.7
"""Simulated before the tool is low, and after it has left or come to rest [s, real]."""
_MIDWAY = 0.6
_STILL_M = 1e-3
"""Way of a tool that has no direction."""
View: TypeAlias = Literal["during", "after"]


class PushParticles(NamedTuple):
    """Predicted or observed particles during and after each push [m], (..., K, N, 3).

    If no view was taken during a push, `during` is as before it.
    """

    during: Float32[np.ndarray, "*batch K N 3"]
    after: Float32[np.ndarray, "*batch K N 3"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class SimulationBatch:
    """The pushes of a study made ready for simulation; K of them."""

    study: Study
    clouds: Float32[np.ndarray, "K N 3"]
    """Particles before each push as observed, whatever errors of cameras are assumed later."""
    labels: Float32[np.ndarray, "K N 4"]
    middles: Float32[np.ndarray, "K N 3"]
    times: Float64[np.ndarray, " K"]
    starts_s: Float64[np.ndarray, " K"]
    stops_s: Float64[np.ndarray, " K"]
    ends_s: Float64[np.ndarray, " K"]
    """Times of the simulation's begin, its stop for the view on the way, and its end; by cameras' and arm's clock."""
    loads: tuple[Load, ...]
    has_during: Bool[np.ndarray, " K"]
    observed: PushParticles
    ways: Float32[np.ndarray, " K"]
    """-1 where the object's other end is called the first than was at first; the cameras' errors stay as drawn."""
    noise_m: float = 1e-3
    smooth: bool = False
    """True if cameras err alike for neighbouring points: of a rod, whose centreline is fitted to all of them."""
    kind: ObjectTraits = ROPE
    tools: Mapping[View, Float64[np.ndarray, "K 4"]] = field(default_factory=dict[View, Float64[np.ndarray, "K 4"]])
    """Tool in the views of each push: x and y of its place [m], and the unit vector along which it goes."""
    bowls: PouredBowls | None = None
    rope: RopeShape | None = None
    """The rope of a rod, whose centreline is found in its clouds."""

    @property
    def modes(self) -> int:
        """Amplitudes, and rows of residuals, of a view; those of the view during a push come first."""
        if self.bowls is not None:
            return CONTENTS
        if self.kind.has_length:
            return 2 * MODES
        return SHEET_MODES if self.kind.is_in_space else PIECE_MODES

    @property
    def axes(self) -> int:
        """Number of axes along which displacements are compared: x and y on a table, z as well in space."""
        return 3 if self.kind.is_in_space else 2

    @property
    def is_empty(self) -> Bool[np.ndarray, " K"]:
        """Mask of the pours in which nothing is seen to be held: whatever flows is not simulated."""
        bowls = self.bowls
        return np.array([bowls is not None and bool(bowls.inside(cloud).all()) for cloud in self.clouds], bool)

    @property
    def after_rows(self) -> slice:
        """Rows of the residuals of the view after a push."""
        return slice(self.modes, 2 * self.modes)

    @property
    def signs_of_other_end(self) -> Float64[np.ndarray, " R"] | None:
        """Sign of each row of both views where the object's other end is called the first; None without ends."""
        return REVERSED if self.kind.has_length else None

    def basis(self, k: int, view: View, cloud: Points) -> Basis:
        """The modes by which a cloud of push `k`, the prediction of a view, is moved onto the observation."""
        if self.kind.has_length:
            return Basis.along(cloud, self.labels[k, :, 0])
        return Basis.over(cloud) if self.kind.is_in_space else Basis.around(cloud, self.tools[view][k])

    def gap(self, k: int, view: View, predicted: Points, observed: Points) -> Float64[np.ndarray, " R"]:
        """Residuals [m] of a cloud of push `k`, the prediction of a view: that which makes it the observation."""
        if self.bowls is not None:
            return contents_m(self.bowls, observed) - contents_m(self.bowls, predicted)
        basis = self.basis(k, view, predicted)
        if self.rope is None:
            return register(predicted, observed, basis)
        return basis.project(centreline_gap(predicted, observed, self._along(k), self.rope))

    def amplitudes(
        self,
        k: int,
        view: View,
        predicted: Points,
        displaced: Float64[np.ndarray, "C N 3"],
        seen: Sequence[int] = (),
    ) -> Float64[np.ndarray, "C R"]:
        """Amplitudes [m] by which residuals of push `k` shrink if its prediction is displaced like this [m].

        `seen`: those displacements that cameras make which err. What is simulated keeps a rope's length by itself.
        """
        planar = displaced[..., : self.axes].copy()
        if self.rope is not None:
            for column in seen:
                planar[column] = gap_of_displaced(displaced[column], predicted, self._along(k), self.rope)
        return self.basis(k, view, predicted).project(planar)

    def _along(self, k: int) -> Float32[np.ndarray, " N"]:
        """Places of the particles of push `k` along an object, from 0 to 1."""
        return (self.labels[k, :, 0] + 1) / 2

    def __len__(self) -> int:
        return len(self.study.pushes)

    def with_ends(self, ends: Mapping[int, float]) -> "SimulationBatch":
        """The same with the object's other end called the first in the episodes in which `ends` is -1."""
        signs = np.array([ends[push.episode] for push in self.study.pushes], np.float32)
        return replace(self, labels=self.labels * signs[:, None, None], ways=self.ways * signs)

    def with_noise(self, seed: int) -> "SimulationBatch":
        """The same pushes of objects that lie a little elsewhere than they were seen, by `noise_m`."""
        rng = np.random.default_rng(seed)
        pushes = tuple(
            replace(push, before=replace(push.before, points=self._add_noise(push.before.points, along, rng)))
            for push, along in zip(self.study.pushes, self.labels[:, :, 0] * self.ways[:, None], strict=True)
        )
        return replace(self, study=replace(self.study, pushes=pushes))

    def begun_from(self, starts: Mapping[int, tuple[int, Points]]) -> "SimulationBatch":
        """Some of the pushes, with the object elsewhere at their beginning.

        `starts`: for each push the one from whose cloud the particles are, and their places now.
        """
        rows, owners = list(starts), [owner for owner, _ in starts.values()]
        clouds = [points for _, points in starts.values()]
        label, middle = (
            np.stack(parts).astype(np.float32)
            for parts in zip(*(self._labels_of(k, cloud) for k, cloud in zip(owners, clouds, strict=True)), strict=True)
        )
        pushes = (self.study.pushes[k] for k in starts)
        begun = (replace(push, before=replace(push.before, points=x)) for push, x in zip(pushes, clouds, strict=True))
        return replace(
            self,
            study=replace(self.study, pushes=tuple(begun)),
            clouds=self.clouds[owners],
            labels=label,
            middles=middle,
            times=self.times[rows],
            starts_s=self.starts_s[rows],
            stops_s=self.stops_s[rows],
            ends_s=self.ends_s[rows],
            loads=tuple(self.loads[k] for k in starts),
            has_during=self.has_during[rows],
            observed=PushParticles(self.observed.during[rows], self.observed.after[rows]),
            ways=self.ways[owners],
            tools={view: places[rows] for view, places in self.tools.items()},
        )

    def _labels_of(self, k: int, cloud: Points) -> tuple[Float64[np.ndarray, "N 4"], Float64[np.ndarray, "N 3"]]:
        """Labels and middles of the object of push `k` where it lies as this cloud."""
        return label_of(self._along(k), cloud) if self.kind.has_length else no_labels(cloud)

    def _add_noise(self, points: Points, along: Float32[np.ndarray, " N"], rng: np.random.Generator) -> Points:
        """Points disturbed by `noise_m` an axis: each independently, or smoothly along the object if `smooth`."""
        moved = points.copy()
        if not self.smooth:
            moved[:, :2] += rng.normal(0, self.noise_m, (len(points), 2))
            return moved
        moved[:, :2] += smooth_noise(rng, along, self.noise_m)
        return moved


def prepare(study: Study, subject: Subject) -> SimulationBatch:
    """Label particles by their place along the object, and find when the tool could touch it."""
    if subject.fingers is not None:
        study = with_held_parts(study, subject.fingers)
    pushes = study.pushes
    labels, middles = label_particles([push.before.points for push in pushes], subject.rods, subject.kind)
    during = [_midway(push, subject) for push in pushes]
    low = [_low_interval(push.track, subject.low_m) for push in pushes]
    starts = np.array([first - _LEAD_S for first, _ in low])
    ends = np.array([last + _TAIL_S for _, last in low])
    stops = np.array(
        [view.time_s if view else (start + end) / 2 for view, start, end in zip(during, starts, ends, strict=True)]
    )
    return SimulationBatch(
        study=study,
        clouds=np.stack([push.before.points for push in pushes]),
        labels=labels,
        middles=middles,
        times=study.session_times(),
        starts_s=starts,
        stops_s=stops,
        ends_s=ends,
        loads=tuple(dragging(push.track, push.before.points, push.after.points, subject) for push in pushes),
        has_during=np.array([view is not None and not subject.kind.is_poured for view in during]),
        observed=PushParticles(
            during=np.stack([(view or push.before).points for view, push in zip(during, pushes, strict=True)]),
            after=np.stack([push.after.points for push in pushes]),
        ),
        ways=np.ones(len(pushes), np.float32),
        smooth=subject.rods is not None,
        kind=subject.kind,
        bowls=subject.bowls,
        rope=None if subject.rods is None else RodStart.of(subject.rods.scene).shape,
        tools={
            "during": _tools_at(pushes, starts, stops),
            "after": _tools_at(pushes, starts, np.array([last for _, last in low])),
        },
    )


def _tools_at(
    pushes: Sequence[Push], starts_s: Float64[np.ndarray, " K"], times_s: Float64[np.ndarray, " K"]
) -> Float64[np.ndarray, "K 4"]:
    """Place of the tool at a time of each push, and the direction in which it has gone; along x where in none."""
    ways = np.stack([push.track.at(np.array(ends)) for push, *ends in zip(pushes, starts_s, times_s, strict=True)])
    gone = (ways[:, 1] - ways[:, 0])[:, :2]
    length = np.linalg.norm(gone, axis=1, keepdims=True)
    ahead = np.where(length > _STILL_M, gone / np.maximum(length, _STILL_M), [1.0, 0.0])
    return np.concatenate([ways[:, 1, :2], ahead], axis=1)


def _low_interval(track: Track, low_m: float) -> tuple[float, float]:
    """Interval in which the tool is low enough to touch the object; its last moment twice if it never is."""
    low = np.flatnonzero(track.poses[:, 2] < low_m)
    if not len(low):
        return float(track.times_s[-1]), float(track.times_s[-1])
    return float(track.times_s[low[0]]), float(track.times_s[low[-1]])


def _midway(push: Push, subject: Subject) -> ProjectionView | None:
    """The view during the push that is nearest to its later half's beginning."""
    if not push.during:
        return None
    first, last = _low_interval(push.track, subject.low_m)
    wanted = first + _MIDWAY * (last - first)
    return min(push.during, key=lambda view: abs(view.time_s - wanted))
