"""Push sessions in the simulated world, on its own clock: no camera, no process, no real time.

Injected effects of the world and its arm are active; recorded are the command, the arm's encoders, and snapshots for
cameras. Everything is determined by the seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.errors import UsageError
from app.core.geometry.track import Track
from app.core.motion import pointing_down
from app.core.types import OPENING, ToolPose
from app.policy.random_pushes import PushDesign
from app.rig.simulated.erring_arm import ErringArm
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.testbeds import find_testbed
from app.rig.simulated.worlds.cloth_world import ClothWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import HOME_TOOL_M, Centreline, WorldPhysics
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.rig.simulated.worlds.world import Nodes, Snapshot, World
from app.tasks.elements.base import Task

SLOT_S = 8.0
"""Time between pushes: longer than the slowest takes, so that a session's time is proportional to its pushes."""
BEGIN_S = 1000.0
"""The clock of every session at its first view."""
_SETTLE_S, _PAUSE_S, _REST_S = 1.0, 0.5, 1.0
"""Time for a laid object to come to rest; for the arm's approach; and for the object to come to rest after the push."""
_TICK_S = 0.01
_ENCODER_M = 1e-4
_DIGITS = 6
"""Decimal digits of a second that are kept of the sum of many time steps."""
_STARTS, _TRACKS, _ENCODERS = 4, 5, 6
"""Random streams of a seed."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class StampedSnapshot:
    """Snapshot of the world at a moment that cameras stamp `stamp_s`.

    `told`: pose of a tool that holds the object by the kinematics, in which reconstructions place what it hides; None
    of other tools.
    """

    stamp_s: float
    snapshot: Snapshot
    told: ToolPose | None = None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PushSample:
    """One push: snapshots before, in the middle and after it, and the tool's path as commanded and as measured."""

    episode: int
    before: StampedSnapshot
    during: StampedSnapshot
    after: StampedSnapshot
    command: Track
    measured: Track


@final
class PushSession:
    """Session of single pushes, driven by the caller: `look`, then `push`, and so on for as many as are planned.

    The task is one of those in `testbeds`; a sweep of its paddle is a push, too.
    """

    def __init__(
        self, task: Task, plan: PushDesign, physics: WorldPhysics, hidden: Sequence[InjectedEffect], seed: int
    ) -> None:
        self.task, self.plan, self._testbed = task, plan, find_testbed(task)
        self.number = 0
        """Index of the next push, or of the one that was looked at for, from 0."""
        self._physics, self._hidden, self._seed = physics, hidden, seed
        self._starts = np.random.default_rng([seed, _STARTS]).integers(2**31, size=plan.episodes).tolist()
        self._arm, self._intrusion = ErringArm(hidden), Intrusion(hidden)
        self._world: World | None = None
        self._before: StampedSnapshot | None = None
        self._last: ToolPose | None = None

    @property
    def episode(self) -> int:
        """Index of the next push's episode, from 0."""
        return self.number // self.plan.pushes

    def look(self) -> StampedSnapshot:
        """The object at rest before the next push; at the beginning of an episode it is laid anew."""
        if self.number >= self.plan.episodes * self.plan.pushes:
            raise UsageError(f"All {self.number} pushes that were planned are made; plan more episodes.")
        begin_s = BEGIN_S + self.episode * self.plan.pushes * SLOT_S
        if self.number % self.plan.pushes == 0:
            self._world, self._last = self._laid_anew(begin_s), None
        assert self._world is not None
        self._intrusion.session = _session(self.number, self.plan)
        due_s = begin_s + self.number % self.plan.pushes * SLOT_S
        if isinstance(self._world, ClothWorld) and self._last is not None:
            self._world.rest(due_s)
        else:
            _wait(self._world, due_s)
        told = self._last if self._last is not None else self._world.tool
        self._before = _rest(self._world, told if self._testbed.holds else None)
        return self._before

    def random(self) -> Track:
        """Random push for the last look; independent of any call before it."""
        world, _ = self._looked_at()
        rng, start_s = np.random.default_rng([self._seed, _TRACKS, self.number]), world.time_s + _PAUSE_S
        held = world.tool if self._last is None and self._testbed.in_hand else self._last
        return self._testbed.draw_track(self.task, rng, world.nodes(), self.plan, start_s=start_s, tool=held)

    def push(self, command: Track) -> PushSample:
        """Execute the push, which must begin after `look`, and take snapshots in its middle and after it."""
        world, before = self._looked_at()
        encoders = np.random.default_rng([self._seed, _ENCODERS, self.number])
        made = self._arm.goes(command, told_only=False)
        if self._last is None:
            world.place(_pose(made, float(made.times_s[0])))
        else:
            world.step(_pose(made, float(made.times_s[0])), float(command.times_s[0]) - world.time_s)
        measured = _measure(self._arm, command, encoders)
        during = self._watch(world, made, command, measured)
        if self._testbed.holds:
            self._last = _pose(command, command.end_s)
            _wait(world, world.time_s + max(_REST_S, self.task.stage.settle_s))
        else:
            _withdraw(world)
        take = PushSample(
            episode=self.episode,
            before=before,
            during=during,
            after=_rest(world, self._last),
            command=command,
            measured=measured,
        )
        self.number, self._before = self.number + 1, None
        return take

    def _watch(self, world: World, made: Track, command: Track, measured: Track) -> StampedSnapshot:
        """Move the tool as the arm made it of the command; the snapshot on the way."""
        stamp_s = self._testbed.midway_s(command)
        _follow(world, made, stamp_s + self._arm.late_s)
        told = _pose(measured, stamp_s) if self._testbed.holds else None
        during = StampedSnapshot(stamp_s=stamp_s, snapshot=world.snapshot(), told=told)
        _follow(world, made, max(made.end_s, command.end_s))
        return during

    def _looked_at(self) -> tuple[World, StampedSnapshot]:
        if self._world is None or self._before is None:
            raise UsageError("Look at the object before a push is chosen and made.")
        return self._world, self._before

    def _laid_anew(self, begin_s: float) -> World:
        start, before = (
            self.task.start(self._starts[self.episode]),
            None if self._world is None else self._world.nodes(),
        )
        self._intrusion = Intrusion(self._hidden)
        return self._testbed.lay(self.task, start, before, self._physics, self._intrusion, begin_s - _SETTLE_S)


def push_again(task: Task, physics: WorldPhysics, start: Centreline, command: Track) -> Float64[np.ndarray, "N 3"]:
    """Rest positions of the world's nodes [m] of a rope laid along `start (K, 3)` after the push `command`."""
    begin_s = float(command.times_s[0]) - _SETTLE_S
    world = RopeWorld(task.rope, task.finger, start, physics=physics, time_s=begin_s)
    _wait(world, float(command.times_s[0]))
    world.place(_pose(command, float(command.times_s[0])))
    _follow(world, command, command.end_s)
    _withdraw(world)
    return world.nodes()


def first_start(task: Task, plan: PushDesign, seed: int) -> Nodes:
    """Nodes of the object [m] where it is laid first."""
    starts = np.random.default_rng([seed, _STARTS]).integers(2**31, size=plan.episodes).tolist()
    return task.start(starts[0])


def _withdraw(world: World) -> None:
    """Withdraw the tool, and let the object come to rest."""
    world.place(pointing_down(np.array(HOME_TOOL_M)))
    _wait(world, world.time_s + _REST_S)


def _rest(world: World, told: ToolPose | None) -> StampedSnapshot:
    """Snapshot of a world at rest, when time offsets have no effect."""
    return StampedSnapshot(stamp_s=round(world.time_s, _DIGITS), snapshot=world.snapshot(), told=told)


def _measure(arm: ErringArm, command: Track, rng: np.random.Generator) -> Track:
    """Encoder track, at the times of the command."""
    told = arm.goes(command, told_only=True)
    at = told.at(command.times_s)
    positions = at + rng.normal(0, _ENCODER_M, at.shape)
    if np.all(command.poses[:, 3:] == command.poses[0, 3:]):
        return command.with_positions(positions)
    turns = told.poses_at(command.times_s)[:, 3:]
    return Track(times_s=command.times_s, poses=np.concatenate([positions, turns], axis=1))


def _follow(world: World, track: Track, until_s: float) -> None:
    """Move the tool along its track until `until_s`."""
    while world.time_s < until_s - _TICK_S / 10:
        due_s = min(world.time_s + _TICK_S, until_s)
        world.step(_pose(track, due_s), due_s - world.time_s)


def _pose(track: Track, at_s: float) -> ToolPose:
    """Pose of the tool at a time; it is closed where the track says nothing of that."""
    (pose,) = track.poses_at(np.array([at_s]))
    return pose if len(pose) > OPENING else np.append(pose, 0.0)


def _wait(world: World, until_s: float) -> None:
    """Advance time with the tool at rest."""
    if until_s > world.time_s:
        world.step(world.tool, until_s - world.time_s)


def _session(number: int, plan: PushDesign) -> float:
    """Position of a push between the first of all (-0.5) and the last (0.5)."""
    return number / max(plan.episodes * plan.pushes - 1, 1) - 0.5
