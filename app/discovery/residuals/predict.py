"""Predicted observations of a model: each push simulated from the view before it, and seen as cameras see it.

Time runs as it was measured, `time_scale` times as fast. The simulation stops once on the way, at the moment of the
view that was taken during the push, where there is one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import jax
import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.spatial import KDTree

from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.labels import label_of, label_particles, middles_of
from app.discovery.dataset.model_under_test import Catalogue, Subject, Theta
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.centreline_noise import smooth_noise
from app.discovery.residuals.steppers import BLOCK, Start, Stepper, chunks, length_ratio, of_one_length, stepper
from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Load, Places
from app.sim.model.numerics import ROD_NUMERICS
from app.sim.model.params import PARAMETERS, index

_LEAD_S, _TAIL_S = 0.05, 0.7
"""Simulated before the tool is low, and after it has left or come to rest [s, real]."""
_MIDWAY = 0.6
_TOUCH_M = 0.018
"""Distance from the tip to the nearest particle at contact."""
_SLOW_M_S = 0.01
_STILL_M = 2e-3
_LEAST_SHARE = 0.1


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
        rows, owners = np.array(list(starts)), np.array([owner for owner, _ in starts.values()])
        clouds = [points for _, points in starts.values()]
        made = [label_of((self.labels[k, :, 0] + 1) / 2, cloud) for k, cloud in zip(owners, clouds, strict=True)]
        pushes = (self.study.pushes[k] for k in starts)
        begun = (replace(push, before=replace(push.before, points=x)) for push, x in zip(pushes, clouds, strict=True))
        return replace(
            self,
            study=replace(self.study, pushes=tuple(begun)),
            clouds=self.clouds[owners],
            labels=np.stack([label for label, _ in made]).astype(np.float32),
            middles=np.stack([middle for _, middle in made]).astype(np.float32),
            times=self.times[rows],
            starts_s=self.starts_s[rows],
            stops_s=self.stops_s[rows],
            ends_s=self.ends_s[rows],
            loads=tuple(self.loads[k] for k in starts),
            has_during=self.has_during[rows],
            observed=PushParticles(self.observed.during[rows], self.observed.after[rows]),
            ways=self.ways[owners],
        )

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
    pushes = study.pushes
    labels, middles = label_particles([push.before.points for push in pushes], subject.rods)
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
        has_during=np.array([view is not None for view in during]),
        observed=PushParticles(
            during=np.stack([(view or push.before).points for view, push in zip(during, pushes, strict=True)]),
            after=np.stack([push.after.points for push in pushes]),
        ),
        ways=np.ones(len(pushes), np.float32),
        smooth=subject.rods is not None,
    )


@final
class Predictor:
    """Simulates pushes under models. Keeps what it compiled."""

    def __init__(self, subject: Subject, catalogue: Catalogue) -> None:
        self.subject, self.catalogue = subject, catalogue
        specs = [spec.name for spec in catalogue.specs]
        self._unknowns = [specs.index(name) for name in ROD_NUMERICS] if subject.rods is not None else []
        own = [range(first, first + len(effect.parameters)) for effect, first in catalogue.apparatus]
        self._apparatus = [column for columns in own for column in columns]
        self._platform = "cpu" if jax.default_backend() == "cpu" else "gpu"

    def __call__(
        self,
        trials: SimulationBatch,
        thetas: Sequence[Theta],
        *,
        subject: Subject | None = None,
        where: Bool[np.ndarray, "Q K"] | None = None,
    ) -> PushParticles:
        """Predictions of each model for every push, or for those of `where`, by this `subject` or another.

        NaN if nothing was simulated, or the simulation left its grid.
        """
        count = len(trials)
        during = np.full((len(thetas), count, *trials.observed.after.shape[1:]), np.nan, np.float32)
        after = np.full_like(during, np.nan)
        own = subject or self.subject
        simulate = stepper(own)
        for group in self._groups(trials, own):
            pushes = sorted(group.needed, key=lambda k: sum(group.needed[k]))
            jobs = [(q, k) for k in pushes for q in range(len(thetas)) if where is None or where[q, k]]
            ways = self._ways(trials, thetas, jobs, group, simulate)
            for chunk in _chunks(jobs, chunks(own, self._platform)):
                found = simulate.move(*self._inputs(trials, thetas, chunk, ways, group.needed))
                for (q, k), mid, end in zip(chunk, *map(np.asarray, found), strict=False):
                    during[q, k] = self._observation(trials, k, mid, thetas[q])
                    after[q, k] = self._observation(trials, k, end, thetas[q])
        return PushParticles(during, after)

    def _observation(self, trials: SimulationBatch, k: int, points: Points, theta: Theta) -> Points:
        """Observation of the object in push k, whose points have moved to `points`, and its middle with them."""
        if not theta[self._apparatus].any() or not np.isfinite(points).all():
            return points
        middle = middles_of((trials.labels[k, :, 0] + 1) / 2, points)
        return self.observe(points, Eye(np.asarray(trials.study.camera), middle.astype(np.float64)), theta)

    def observe(self, points: Points, eye: Eye, theta: Theta) -> Points:
        """Observation of points by the cameras."""
        return self.project(points.astype(np.float64), eye, theta).astype(np.float32)

    def project(self, places: Places, eye: Eye, theta: Theta) -> Places:
        """The same in full precision."""
        for effect, values in self.catalogue.wrong(theta):
            if effect.see is not None:
                places = effect.see(places, eye, values)
        return places

    def unproject(self, points: Points, eye: Eye, theta: Theta) -> Points:
        """True positions of observed points: the inverse of `observe`, by fixed-point iteration."""
        places = points
        for _ in range(2):
            places = points - (self.observe(places, eye, theta) - places)
        return places

    def actual_track(self, push: Push, load: Load, theta: Theta) -> Track:
        """True track of the tool, from the recorded one."""
        measured = push.measured is not None
        return self.apply_errors(push.track, load, theta, lambda effect: not (effect.told and measured))

    def encoder_track(self, command: Track, load: Load, theta: Theta) -> Track:
        """Encoder track of the arm for a command that it executes."""
        return self.apply_errors(command, load, theta, lambda effect: effect.told)

    def apply_errors(self, track: Track, load: Load, theta: Theta, by: Callable[[Apparatus], bool]) -> Track:
        """The track with the errors of those effects that `by` selects."""
        for effect, values in self.catalogue.wrong(theta):
            if effect.drive is not None and by(effect):
                track = effect.drive(track, load, values)
        return track

    def late_s(self, theta: Theta) -> float:
        """Delay of the image stamps: images are this much younger than they say."""
        late = (effect.late_s(values) for effect, values in self.catalogue.wrong(theta) if effect.late_s is not None)
        return sum(late, 0.0)

    def _groups(self, trials: SimulationBatch, subject: Subject) -> list["_Group"]:
        """Pushes whose paths have as many blocks of time steps together."""
        step_s, ratio = subject.step_s, length_ratio(subject, self._platform)
        found = dict[tuple[int, int], dict[int, tuple[int, int]]]()
        for k, (start, stop, end) in enumerate(zip(trials.starts_s, trials.stops_s, trials.ends_s, strict=True)):
            steps = math.ceil((stop - start) / step_s), math.ceil((end - stop) / step_s)
            found.setdefault((_blocks(steps[0], ratio), _blocks(steps[1], ratio)), {})[k] = steps
        if of_one_length(subject) and found:
            longest = max(first for first, _ in found), max(second for _, second in found)
            found = {longest: {k: steps for own in found.values() for k, steps in own.items()}}
        return [_Group(needed, *lengths, step_s) for lengths, needed in found.items()]

    def _inputs(
        self,
        trials: SimulationBatch,
        thetas: Sequence[Theta],
        jobs: Sequence[tuple[int, int]],
        ways: "_Ways",
        needed: Mapping[int, tuple[int, int]],
    ) -> tuple[np.ndarray | Start, ...]:
        theta = np.stack([thetas[q] for q, _ in jobs]).astype(np.float32)
        rows = [ways.row[self._way(k, thetas[q])] for q, k in jobs]
        pushes = [k for _, k in jobs]
        return (
            theta[:, : len(PARAMETERS)],
            theta[:, self._unknowns],
            tuple(part[rows] for part in ways.start),
            trials.labels[pushes],
            trials.times[pushes].astype(np.float32),
            ways.to_stop[rows],
            ways.to_end[rows],
            np.array([needed[k] for k in pushes], np.int32),
        )

    def _ways(
        self,
        trials: SimulationBatch,
        thetas: Sequence[Theta],
        jobs: Sequence[tuple[int, int]],
        group: "_Group",
        simulate: Stepper,
    ) -> "_Ways":
        """Initial states and tool paths of pushes, once for all models that agree about the apparatus."""
        first = dict[tuple[int, bytes], tuple[int, int]]()
        for q, k in jobs:
            first.setdefault(self._way(k, thetas[q]), (q, k))
        made = [self._seen_from(trials, k, thetas[q], group) for q, k in first.values()]
        x, to_stop, to_end = (np.stack(parts) for parts in zip(*made, strict=True)) if made else (np.zeros(0),) * 3
        row = {key: number for number, key in enumerate(first)}
        seen = trials.clouds[[k for _, k in first.values()]]
        return _Ways(row, simulate.begin(x, seen) if made else (), to_stop, to_end)

    def _way(self, k: int, theta: Theta) -> tuple[int, bytes]:
        """All that a push's beginning and its tool's way depend on."""
        return k, theta[self._apparatus].tobytes()

    def _seen_from(
        self, trials: SimulationBatch, k: int, theta: Theta, group: "_Group"
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Particles before push k, and the tool's path to the stop and on, if the apparatus has these errors."""
        push, step = trials.study.pushes[k], group.step_s
        eye = Eye(np.asarray(trials.study.camera), trials.middles[k].astype(np.float64))
        track = self.actual_track(push, trials.loads[k], theta)
        stop = trials.stops_s[k] + self.late_s(theta)
        to_stop = track.at(stop - step * np.arange(BLOCK * group.to_stop, -1, -1))
        to_end = track.at(stop + step * np.arange(BLOCK * group.to_end + 1))
        x = self.unproject(push.before.points, eye, theta)
        return x.astype(np.float32), to_stop.astype(np.float32), to_end.astype(np.float32)


class _Group(NamedTuple):
    """Pushes whose view on the way is after `to_stop` blocks, and whose end is `to_end` after that.

    `needed`: the time steps that each really takes to either.
    """

    needed: Mapping[int, tuple[int, int]]
    to_stop: int
    to_end: int
    step_s: float


class _Ways(NamedTuple):
    """Initial states and tool paths; `row` maps jobs to them."""

    row: dict[tuple[int, bytes], int]
    start: Start
    to_stop: Float32[np.ndarray, "W T 3"]
    to_end: Float32[np.ndarray, "W T 3"]


def _blocks(steps: int, ratio: float) -> int:
    """Number of blocks that these substeps take, in powers of `ratio` if that is above 1."""
    needed = max(1, math.ceil(steps / BLOCK))
    return needed if ratio == 1 else math.ceil(ratio ** math.ceil(math.log(needed, ratio)))


def _chunks(jobs: list[tuple[int, int]], sizes: Sequence[int]) -> list[list[tuple[int, int]]]:
    """Lists of one of these sizes, the last filled up with repetitions: few shapes are compiled."""
    chunks = list[list[tuple[int, int]]]()
    at = 0
    while at < len(jobs):
        left = len(jobs) - at
        size = next((size for size in sizes if size >= left), sizes[-1])
        part = jobs[at : at + size]
        chunks.append(part + [part[-1]] * (size - len(part)))
        at += size
    return chunks


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


def resisting(track: Track, x: Points, share: float, subject: Subject) -> Load:
    """Coulomb friction of a share of the object `x` against the tool's motion, from the first touch on."""
    tip, velocity = track.positions, track.velocity(track.times_s)
    near = np.asarray(KDTree(x[:, :2]).query(tip[:, :2])[0])
    low = tip[:, 2] < subject.low_m
    touched = np.maximum.accumulate((near < _TOUCH_M) & low) & low
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    friction = float(subject.nominal[index("table_friction")]) * subject.mass_kg * 9.81
    return Load(-share * friction * touched[:, None] * velocity / np.maximum(speed, _SLOW_M_S))


def dragging(track: Track, before: Points, after: Points, subject: Subject) -> Load:
    """Load on a tool that pushes along `track`, by the share of the object that it moved."""
    moved = np.asarray(KDTree(after[:, :2]).query(before[:, :2])[0])
    share = float((moved > 3 * np.median(moved) + _STILL_M).mean())
    return resisting(track, before, max(share, _LEAST_SHARE), subject)
