"""Predicted observations of a model: each push simulated from the view before it, and seen as cameras see it.

Time runs as it was measured, `time_scale` times as fast. The simulation stops once on the way, at the moment of the
view that was taken during the push, where there is one.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Final, NamedTuple, final

import jax
import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.core.geometry.track import Track, upright
from app.core.types import Points
from app.discovery.dataset.labels import middles_of
from app.discovery.dataset.model_under_test import Catalogue, Subject, Theta
from app.discovery.dataset.study import Push
from app.discovery.residuals.simulation_batch import PushParticles, SimulationBatch
from app.discovery.residuals.steppers import BLOCK, Start, Stepper, chunks, length_ratio, of_one_length, stepper
from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Load, Places
from app.sim.model.numerics import POUR_NUMERICS, ROD_NUMERICS
from app.sim.model.params import PARAMETERS

_POUR_STEPS: Final = np.array([unknown.step for unknown in POUR_NUMERICS.values()])


@final
class Predictor:
    """Simulates pushes under models. Keeps what it compiled, and of liquids what it simulated."""

    def __init__(self, subject: Subject, catalogue: Catalogue) -> None:
        self.subject, self.catalogue = subject, catalogue
        specs = [spec.name for spec in catalogue.specs]
        self._unknowns = [specs.index(name) for name in ROD_NUMERICS] if subject.rods is not None else []
        own = [range(first, first + len(effect.parameters)) for effect, first in catalogue.apparatus]
        self._apparatus = [column for columns in own for column in columns]
        seen = {column for effect, first in catalogue.apparatus for column in _columns(effect, first)}
        seen |= {specs.index(name) for name in POUR_NUMERICS if name in specs}
        told = {c for effect, first in catalogue.apparatus if effect.told for c in _range(effect, first)}
        self._felt = [column for column in range(len(specs)) if column not in seen]
        self._felt_beside_log = [column for column in self._felt if column not in told]
        self._pour_columns = [specs.index(name) for name in POUR_NUMERICS] if subject.kind.is_poured else []
        self._kept = dict[tuple[bytes, ...], tuple[Points, Points]]()
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
            alike = self.group_alike(trials, jobs, thetas)
            keys = {job: self._key(trials, job, thetas, own) for job in alike}
            known = {job: self._kept[key] for job, key in keys.items() if key in self._kept}
            new = [job for job in alike if job not in known]
            sizes = chunks(own, self._platform)
            for job, (mid, end) in chain(known.items(), self._simulate(trials, thetas, new, group, simulate, sizes)):
                if own.bowls is not None:
                    self._kept[keys[job]] = mid, end
                for q, k in alike[job]:
                    during[q, k] = self._observation(trials, k, mid, thetas[q])
                    after[q, k] = self._observation(trials, k, end, thetas[q])
        return PushParticles(during, after)

    def _simulate(
        self,
        trials: SimulationBatch,
        thetas: Sequence[Theta],
        jobs: list[tuple[int, int]],
        group: "_Group",
        simulate: Stepper,
        sizes: Sequence[int],
    ) -> Iterator[tuple[tuple[int, int], tuple[Points, Points]]]:
        """Each job, with the object on the way and at the end; so many at once."""
        if not jobs:
            return
        ways = self._ways(trials, thetas, jobs, group, simulate)
        for chunk in _chunks(jobs, sizes):
            found = simulate.move(*self._inputs(trials, thetas, chunk, ways, group.needed))
            middles, ends = map(np.asarray, found)
            yield from zip(chunk, zip(middles, ends, strict=True), strict=True)

    def group_alike(
        self, trials: SimulationBatch, jobs: Sequence[tuple[int, int]], thetas: Sequence[Theta]
    ) -> Mapping[tuple[int, int], Sequence[tuple[int, int]]]:
        """Jobs that are one simulation, by the first: those of a liquid whose models differ in cameras alone."""
        if self.subject.bowls is None:
            return {job: (job,) for job in jobs}
        first, found = dict[tuple[int, bytes], tuple[int, int]](), dict[tuple[int, int], list[tuple[int, int]]]()
        for q, k in jobs:
            found.setdefault(
                first.setdefault((k, self._felt_of(thetas[q], trials.study.pushes[k])), (q, k)), []
            ).append((q, k))
        return found

    def _key(
        self, trials: SimulationBatch, job: tuple[int, int], thetas: Sequence[Theta], subject: Subject
    ) -> tuple[bytes, ...]:
        """All that a simulation of a liquid depends on; of what else is simulated nothing is kept."""
        if subject.bowls is None:
            return ()
        q, k = job
        push, times = trials.study.pushes[k], np.array([trials.starts_s[k], trials.stops_s[k], trials.ends_s[k]])
        return (
            push.before.points.tobytes(),
            push.track.poses.tobytes(),
            times.tobytes(),
            self._felt_of(thetas[q], push),
        )

    def _felt_of(self, theta: Theta, push: Push) -> bytes:
        """All of a model that changes the simulation of a liquid; not what is in the arm's own log."""
        return theta[self._felt if push.measured is None else self._felt_beside_log].tobytes()

    def _observation(self, trials: SimulationBatch, k: int, points: Points, theta: Theta) -> Points:
        """Observation of the object in push k, whose points have moved to `points`, and its middle with them."""
        if not np.isfinite(points).all():
            return points
        if trials.bowls is not None:
            return self.observe_level(trials, k, points, theta)
        if not theta[self._apparatus].any():
            return points
        along = (trials.labels[k, :, 0] + 1) / 2
        middle = middles_of(along, points) if trials.kind.has_length else points
        return self.observe(points, Eye(np.asarray(trials.study.camera), middle.astype(np.float64)), theta)

    def observe_level(self, trials: SimulationBatch, k: int, points: Points, theta: Theta) -> Points:
        """Observation of a liquid in push k, as much as numerics let out: filled to a level that is seen too high.

        So it was seen before the push, too.
        """
        bowls = trials.bowls
        assert bowls is not None
        surface, eye = np.array([bowls.place_m]), Eye(np.asarray(trials.study.camera), None)
        by_m = float((self.project(surface, eye, theta) - surface)[0, 2])
        seen = trials.study.pushes[k].before.points
        counted, first = bowls.share(seen), bowls.seen_share(seen)
        outflow, lip, spilt = _POUR_STEPS * theta[self._pour_columns]
        more = self.more(theta) - spilt * first
        poured = bowls.worth(counted, more) * (bowls.share(points) - counted)
        poured += outflow * poured - lip * min(max(poured / POUR_NUMERICS["lip_height"].step, 0.0), 1.0)
        share = first + min(poured, max(1 + more - first, 0.0))
        return bowls.with_share(points, share + bowls.rise(share, by_m) - bowls.rise(first, by_m))

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

    def more(self, theta: Theta) -> float:
        """Share of a liquid's volume by which there is more of it than was said."""
        return sum((effect.more(values) for effect, values in self.catalogue.wrong(theta) if effect.more), 0.0)

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
        # A liquid is seen at rest alone.
        stop = trials.stops_s[k] + (self.late_s(theta) if trials.bowls is None else 0.0)
        to_stop = self._tool(track, stop - step * np.arange(BLOCK * group.to_stop, -1, -1))
        to_end = self._tool(track, stop + step * np.arange(BLOCK * group.to_end + 1))
        x = push.before.points
        if trials.bowls is None:
            x = self.unproject(x, eye, theta)
        else:  # A reconstruction has it in the bowls as it knows them; the held one takes what is in it along.
            x = trials.bowls.carry(x, push.track.positions[0], track.positions[0])
            x = trials.bowls.fill(x, track.positions[0], self.more(theta))
        return x.astype(np.float32), to_stop.astype(np.float32), to_end.astype(np.float32)

    def _tool(self, track: Track, times_s: Float64[np.ndarray, " S"]) -> Float64[np.ndarray, "S T"]:
        """The tool's coordinates at these times, as the simulator takes them."""
        if self.subject.tool_coordinates == 3:
            return track.at(times_s)
        poses = track.poses_at(times_s)
        openings = poses[:, 7 : self.subject.tool_coordinates]
        return np.concatenate([poses[:, :3], upright(poses[:, 3:7]), openings], axis=1)


def _columns(effect: Apparatus, first: int) -> Sequence[int]:
    """Columns of an error that is in what is seen alone."""
    return () if effect.drive is not None or effect.more is not None else _range(effect, first)


def _range(effect: Apparatus, first: int) -> range:
    return range(first, first + len(effect.parameters))


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
    to_stop: Float32[np.ndarray, "W S T"]
    to_end: Float32[np.ndarray, "W S T"]


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
