"""Compensation of the errors of cameras and arm that a model has: true positions, and commands to the arm.

The simulator, the planner and goals are in the true world frame, that of the robot's base. Clouds, and data compared
with them, are in the frame of the cameras; motions are commands to the arm. Recordings hold both as they were.

A reconstruction has a liquid in the bowls as it knows them. Errors of cameras raise or lower its level and move no
cloud (docs/decisions/0029-poured.md); what is in the held bowl is where the arm has it. How much there is of it the
reconstruction is told. Where there is more, or less, each true particle is an equal share of all that there is
(docs/decisions/0032-more-than-was-said.md).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.config import Site
from app.core.geometry.bowls import cap_centroid_m, cap_depth_m, cap_volume_m3
from app.core.geometry.track import Track
from app.core.messages import Branch, Model, Transition
from app.core.motion import TOOL_DOWN, Motion
from app.core.types import Path3, Points, ToolPose
from app.discovery.dataset.labels import middles_of, places_along
from app.discovery.dataset.model_under_test import Theta
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.tool_load import dragging
from app.discovery.sensor_actuator_errors.base import Eye, Load
from app.jobs.discovery_subject import subject_of
from app.perception.body.resample import resample
from app.perception.body.vessels import Pool, Vessel
from app.planner.base import Planner
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest
from app.tasks import load

_Turns: TypeAlias = Float64[np.ndarray, "T 4"]
_Along: TypeAlias = Callable[[], Float32[np.ndarray, " N"]]

_PAUSE_S = 1e4
"""Time between two positions of a path, so slow that no delay or lag shows."""
_POINTS_A_PARTICLE = 8
"""Points of a pool for each of its particles, which are means of them."""
_LAYERS = 4
"""Layers of points in a pool at least."""
_LEAST = 0.005
"""Share of a liquid below which none is in a bowl."""
_ROUNDS = 12
"""Iterations of an inverse: an arm that leaves out a fifth of a stroke, the most of all, is undone to a nanometre."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Correction:
    """`theta`: a model's values by discovery's catalogue; `camera_m`: about where errors of the cameras are."""

    predictor: Predictor
    theta: Theta
    camera_m: Float64[np.ndarray, "3"]

    def plan(self, planner: Planner, request: PlanRequest) -> Plan:
        """Plan for the object that cameras observe at `request.observed` [m], so that it truly reaches the goal.

        The motion is the command to the arm, predictions are as the cameras will show them; distances are true. The
        centreline after it, and the one it is `near`, are in the true frame.
        """
        command = partial(self.command, site=request.site)
        true = self.true_request(request)
        found = planner(replace(true, command=command))
        along = cache(lambda: self._along(true.observed))
        branches = tuple(self._observed_branch(branch, along) for branch in found.branches)
        return replace(found, branches=branches, predicted=branches[found.best].predicted)

    def true_request(self, request: PlanRequest) -> PlanRequest:
        """The request for the object and the tool as they truly are."""
        told = request.tool
        tool = None if told is None else self.true_tool(told)
        return replace(request, observed=self.unproject(request.observed, told), tool=tool, told_tool=told)

    def true_tool(self, told: ToolPose) -> ToolPose:
        """True pose of a tool that is at rest, and by the arm's own account is here."""
        stays = np.stack([told, told])
        there = self.executed_path(stays[:, :3], _unloaded(2), stays[:, 3:7])
        return np.concatenate([there[-1], told[3:]])

    def unproject(self, points: Points, tool: ToolPose | None = None) -> Points:
        """True position of the object that cameras observe here [m].

        Cameras do not move a liquid, of which the particles are as many as ever: in a held bowl that by the arm's own
        account is at `tool` they are where that truly is, and stand there as high as they truly do.
        """
        bowls = self.predictor.subject.bowls
        if bowls is None:
            return self.predictor.unproject(points, self._eye(points), self.theta)
        if tool is None:
            return points
        true = self.true_tool(tool)[:3]
        return self._true_content(bowls.carry(points, tool[:3], true), true)

    def observe(self, points: Points, along: _Along | None = None) -> Points:
        """Observed position of the object that truly is here [m]; non-finite as the input is.

        `along`: how far along it its particles are, if that was found where it lay before.
        Of a liquid as much is shown in the bowl that stands as cameras will see there. Where all of it stands and there
        is less than was said, all is shown, though a reconstruction has what it misses in the held bowl.
        """
        bowls = self.predictor.subject.bowls
        if not np.isfinite(points).all():
            return points
        if bowls is None:
            return self.predictor.observe(points, self._eye(points, along), self.theta)
        drops, ratio = self._drops(len(points))
        inside = bowls.inside(points)
        return _with_count(points, inside, round(ratio * int(inside[:drops].sum())), drops)

    def command(self, motion: Motion, before: Points, after: Points, site: Site) -> Motion:
        """Command to the arm so that its tip makes `motion`, which moves the object from `before` to `after`.

        It compensates errors of the path, however slow the motion, and not delay and lag, which change its timing
        (docs/decisions/0007-extended-models.md). No lower than the site's workspace; one that continues begins where
        the arm has the tool, by its own account.
        """
        felt = self._drag_load(motion, before, after)
        told = motion.positions
        for _ in range(_ROUNDS):
            told = told + motion.positions - self.executed_path(told, felt, motion.poses[:, 3:7])
        told[:, 2] = np.maximum(told[:, 2], min(site.limits.workspace.low[2], float(motion.positions[:, 2].min())))
        if motion.continues:
            begins = np.repeat(motion.positions[:1], 2, axis=0)
            told[0] = 2 * begins[0] - self.executed_path(begins, _unloaded(2), motion.poses[[0, 0], 3:7])[0]
        return replace(motion, positions=told)

    def executed_path(self, told: Path3, felt: Load, turns: _Turns | None = None) -> Path3:
        """Path of the tip [m] of an arm that is commanded this one, slowly, against these forces.

        `turns`: quaternions w x y z of the tool along it; None where it points down, unturned.
        """
        track = _track(told, _PAUSE_S * np.arange(len(told)), turns)
        return self.predictor.apply_errors(track, felt, self.theta, lambda _: True).positions

    def transition(self, seen: Transition) -> Transition:
        """The true transition: positions of the object, and the tip's path in place of the measured one.

        What is in a held bowl is where that truly is.
        """
        before, after = seen.before, seen.after
        bowls = self.predictor.subject.bowls
        if bowls is None:
            before, after = self.unproject(before), self.unproject(after)
        executed, measured = seen.executed, len(seen.executed.measured) > 0
        track = Track(times_s=executed.times_s, poses=executed.made)
        felt = dragging(track, before, after, self.predictor.subject)
        made = self.predictor.apply_errors(track, felt, self.theta, lambda effect: not (effect.told and measured))
        if bowls is not None:
            before, after = (
                self._true_content(bowls.carry(points, track.positions[end], made.positions[end]), made.positions[end])
                for points, end in ((before, 0), (after, -1))
            )
        return replace(seen, before=before, after=after, executed=replace(executed, measured=made.poses))

    def _drops(self, count: int) -> tuple[int, float]:
        """Number of particles that are none of pieces; all of the liquid that there is over what was said."""
        subject = self.predictor.subject
        drops = subject.scene.split(count)[0]
        return drops, 1 + self.predictor.more(self.theta) * count / drops

    def _true_content(self, points: Points, tool_m: Float64[np.ndarray, "3"]) -> Points:
        """The particles, each an equal share of all of the liquid that there is; the held bowl is truly at `tool_m`.

        Pieces stay in their bowl, and rise with the level.
        """
        bowls, more = self.predictor.subject.bowls, self.predictor.more(self.theta)
        if bowls is None or more == 0:
            return points
        inside, place, (drops, ratio) = bowls.inside(points), np.array(bowls.place_m), self._drops(len(points))
        stands_m3 = float(inside.mean()) * bowls.volume_m3
        if inside.all() and more > 0:  # It may be more than a reconstruction has particles for.
            level_m3 = _volume_m3(points, bowls.radius_m, stands_m3, place)
            stands_m3 = min(max(level_m3, stands_m3), (1 + more) * stands_m3)
        held_m3 = max((1 + more) * bowls.volume_m3 - stands_m3, 0.0)
        liquid = stands_m3 / bowls.volume_m3 * len(points) - float(inside[drops:].sum())
        stand = drops if held_m3 < _LEAST * bowls.volume_m3 else min(round(liquid / ratio), drops)
        true = bowls.fill(points, tool_m, more).copy()
        standing = _pool(bowls.radius_m, stands_m3, stand, place)
        true[:drops] = np.concatenate([standing, _pool(bowls.held_radius_m, held_m3, drops - stand, tool_m)])
        return true

    def _observed_branch(self, branch: Branch, along: _Along) -> Branch:
        predicted, final, *frames = (self.observe(x, along) for x in (branch.predicted, branch.final, *branch.frames))
        return replace(branch, predicted=predicted, final=final, frames=np.stack(frames) if frames else branch.frames)

    def _eye(self, points: Points, along: _Along | None = None) -> Eye:
        if not self.predictor.subject.kind.has_length:
            return Eye(self.camera_m, points.astype(np.float64))
        places = along or partial(self._along, points)
        return Eye(self.camera_m, cache(lambda: middles_of(places(), points).astype(np.float64)))

    def _along(self, points: Points) -> Float32[np.ndarray, " N"]:
        return places_along(points, self.predictor.subject.rods)

    def _drag_load(self, motion: Motion, before: Points, after: Points) -> Load:
        lengths = np.linalg.norm(np.diff(motion.positions, axis=0), axis=1)
        times = np.concatenate([[0.0], np.cumsum(lengths / motion.speeds[1:])])
        known = after if np.isfinite(after).all() else before
        return dragging(_track(motion.positions, times, motion.poses[:, 3:7]), before, known, self.predictor.subject)


def correction(model: Model) -> Correction:
    """Corrections of `model`, which has to have some. Raises UsageError for a task without pushes."""
    predictor = _predictor(model.task)
    theta = predictor.catalogue.nominal(predictor.subject)
    for parameter in model.apparatus:
        theta[predictor.catalogue.column(parameter.name)] = parameter.value
    return Correction(predictor=predictor, theta=theta, camera_m=np.array(model.extension.camera_m))


def _pool(radius_m: float, volume_m3: float, count: int, centre: Float64[np.ndarray, "3"]) -> Points:
    """So many particles throughout a liquid at rest in a bowl about `centre` [m]."""
    if not count:
        return np.zeros((0, 3), np.float32)
    x, y, z = (float(place) for place in centre)
    depth_m = cap_depth_m(volume_m3, radius_m)
    pool = Pool(vessel=Vessel(radius_m=radius_m, place_m=(x, y, z)), level_m=z - radius_m + depth_m)
    apart_m = min(float(np.cbrt(volume_m3 / (_POINTS_A_PARTICLE * count))), depth_m / _LAYERS)
    return resample(pool.points(apart_m), count, seed=0)


def _volume_m3(points: Points, radius_m: float, said_m3: float, centre: Float64[np.ndarray, "3"]) -> float:
    """Volume of a liquid in a bowl about `centre` [m] by the mean height of its particles.

    They are a little higher or lower than the liquid, as those of a pool of `said_m3` are.
    """
    said = _pool(radius_m, said_m3, len(points), centre)
    rises_m = float(points[:, 2].mean(dtype=np.float64) - said[:, 2].mean(dtype=np.float64))
    return cap_volume_m3(cap_centroid_m(cap_depth_m(said_m3, radius_m), radius_m) - rises_m, radius_m)


def _with_count(points: Points, inside: Bool[np.ndarray, " N"], wanted: int, drops: int) -> Points:
    """The points with so many of the first `drops` inside, as far as there are any to lie upon."""
    shown, of_drops = points.copy(), inside[:drops]
    there, elsewhere = np.flatnonzero(of_drops), np.flatnonzero(~of_drops)
    by = min(wanted, drops) - len(there)
    source, moved = (there, elsewhere) if by > 0 else (elsewhere, there)
    if by and len(source):
        moved = moved[np.linspace(0, len(moved) - 1, abs(by)).astype(int)]
        shown[moved] = points[source[np.arange(abs(by)) % len(source)]]
    return shown


@lru_cache
def _predictor(task: str) -> Predictor:
    subject = subject_of(load(task))
    return Predictor(subject, subject.catalogue())


def _unloaded(count: int) -> Load:
    return Load(np.zeros((count, 3)))


def _track(positions: Path3, times_s: Float64[np.ndarray, " T"], turns: _Turns | None) -> Track:
    turned = np.tile(TOOL_DOWN, (len(positions), 1)) if turns is None else turns
    return Track(times_s=times_s, poses=np.concatenate([positions, turned], axis=1))
