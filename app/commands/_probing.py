"""Experiments in the simulated cell on its own clock: each episode seen, chosen, checked, made and recorded."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from app.arm.gate import refusal
from app.commands._hiding import PushRecordingConfig, RecordedCell, Stopwatch
from app.config import Site
from app.core.errors import PlanningError, UsageError
from app.core.geometry.track import Track
from app.core.messages import Particles
from app.core.task_name import recorded_name
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.experiments.probe import Belief
from app.discovery.experiments.probe_pushes import Probe
from app.jobs.probed import belief, next_probe, probe_motion, probed_subject
from app.perception.body.resample_to_count import resample_to
from app.rig.simulated.push_session import PushSample
from app.session.loop import complete, go_round
from app.tasks.elements.base import Task

_REJECTIONS = 20
"""Rejected pushes in a row after which an experiment ends with an error."""


class _Offer(NamedTuple):
    """Push that is offered, in words, and the belief expected once it is made. `asked`: somebody asked for it."""

    track: Track
    text: str
    then: Belief
    asked: bool = False


@final
class ProbedCell:
    """The simulated cell, whose pushes are chosen: stages of the loop, of which `play` goes round an episode.

    `task`: what they are simulated as; `asked`: pushes to make first; `approve` is told each push and says whether it
    is made. Each passes the checks of the arm's own process before it is shown.
    """

    def __init__(
        self,
        session: PushRecordingConfig,
        task: Task,
        *,
        site: Site,
        approve: Callable[[str], bool],
        asked: Sequence[Track] = (),
    ) -> None:
        self.session = session
        self._task, self._site, self._approve, self._asked = task, site, approve, list(asked)
        self._count = probed_subject(task).particle_count
        self._cell = RecordedCell(session, Stopwatch())
        self._made, self._draws, self._rejected = list[Push](), 0, 0

    @property
    def recordings(self) -> list[Path]:
        """The episodes so far."""
        return [self.session.path(episode) for episode in range(-(-self._cell.number // self.session.plan.pushes))]

    def play(self, held: Belief, pushes: int) -> None:
        """The next episode of so many pushes, recorded, each chosen for its information.

        Raises UsageError where every push is rejected, PerceptionError where the object cannot be seen any more,
        RecordingError where the file cannot be written.
        """
        self._held, last = held, self._cell.number + pushes
        with self._cell.recording():
            while self._cell.number < last:
                complete(go_round(self))

    async def observe(self) -> Particles:
        """The object at rest."""
        return self._cell.look()

    async def plan(self, observed: Particles) -> _Offer | None:
        """The next push for the object where it is; None where one that was asked for cannot be made there."""
        seen = self._view(observed)
        if self._asked:
            track = self._aim_push(self._asked.pop(0), seen)
            return track and _Offer(track, "A push that you asked for", self._held, asked=True)
        try:
            probe = self._chosen(seen)
        except PlanningError:
            text = "A random push, as no other brings the rope back to where it can be pushed"
            return _Offer(self._home(), text, self._held)
        return _Offer(probe.track, probe.text, self._held.expecting(probe.information))

    async def approve(self, plan: _Offer) -> _Offer | None:
        """The push, if it is approved. Raises UsageError where too many in a row are not."""
        if self._approve(plan.text):
            self._rejected = 0
            return plan
        self._rejected += not plan.asked
        if self._rejected == _REJECTIONS:
            raise UsageError(f"{_REJECTIONS} pushes were rejected in a row; what is recorded is kept.")
        return None

    async def execute(self, leave: _Offer) -> PushSample:
        """The push as the world made it."""
        self._held = leave.then
        return self._cell.push(leave.track)

    async def learn(self, made: PushSample) -> None:
        """Record it, and let the next choice know what it did."""
        before, told = self._cell.record(made)
        *during, after = (self._view(message) for message in told if isinstance(message, Particles))
        self._made.append(
            Push(
                episode=made.episode,
                before=self._view(before),
                during=tuple(during),
                after=after,
                command=made.command,
                measured=made.measured,
            )
        )

    def _chosen(self, seen: ProjectionView) -> Probe:
        self._draws += 1
        seed = int(np.random.default_rng([self.session.seed, self._draws]).integers(2**31))
        plan = self.session.plan
        episode = self._cell.episode
        return next_probe(self._task.name, self._held, seen, episode, self._made, plan, seed, self._site)

    def _home(self) -> Track:
        """A random push, most of which go towards the middle. Raises PlanningError where it may not be made."""
        track = self._cell.world.random()
        why = refusal(probe_motion(self._task, track, self._site), self._site)
        if why:
            raise PlanningError(f"The rope lies where no push may be made: {why}")
        return track

    def _aim_push(self, track: Track, seen: ProjectionView) -> Track | None:
        """A push that was asked for, moved to where the object is; None where it does not fit, or may not be made."""
        from app.jobs.suggestions.strokes import aim_at
        from app.planner.actions.actions import Pushes

        assert isinstance(self._task.actions, Pushes)
        motion = probe_motion(self._task, track, self._site)
        try:
            at = aim_at(motion, seen.points, self._task.actions, self._site)
        except PlanningError:
            return None
        shift = at.positions[0] - motion.positions[0]
        late_s = seen.time_s + 0.5 - float(track.times_s[0])
        moved = replace(track, times_s=track.times_s + late_s).with_positions(track.positions + shift)
        return moved if refusal(probe_motion(self._task, moved, self._site), self._site) == "" else None

    def _view(self, particles: Particles) -> ProjectionView:
        return ProjectionView(time_s=particles.time_s, points=resample_to(particles.positions, self._count))


def recommend(task: Task, study: Study, held: Belief, count: int, *, seed: int, site: Site) -> list[Probe]:
    """The next pushes to make: for the object as observed last, then as each is predicted to leave it.

    Raises PlanningError where not one may be made; fewer are given where the rope would then leave the table.
    """
    from app.policy.random_pushes import PushDesign

    last = study.pushes[-1]
    measured = all(push.measured is not None for push in study.pushes)
    plan = PushDesign(measured=measured, during=all(push.during for push in study.pushes))
    seen, made, found = last.after, list(study.pushes), list[Probe]()
    for number in range(count):
        try:
            probe = next_probe(task.name, held, seen, last.episode, made, plan, seed + number, site)
        except PlanningError:
            if not found:
                raise
            break
        found.append(probe)
        held, track = held.expecting(probe.information), probe.track
        after = ProjectionView(time_s=track.end_s, points=probe.predicted)
        made.append(Push(episode=last.episode, before=seen, during=(), after=after, command=track, measured=None))
        seen = after
    return found


def believed_of(task: Task, study: Study | None) -> Belief:
    """Belief after a study of a task. Raises UsageError if the study is of another."""
    if study is not None and study.task != recorded_name(task.name):
        raise UsageError(f"The recordings are of {study.task}, not of {recorded_name(task.name)}; name that task.")
    return belief(task.name, study)
