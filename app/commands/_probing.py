"""Experiments in the simulated cell on its own clock: each episode seen, chosen, checked, made and recorded."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import final

import numpy as np

from app.commands._hiding import PushRecordingConfig, Scribe, Stopwatch, begun_file
from app.config import Site
from app.core.errors import PlanningError, RecordingError, UsageError
from app.core.geometry.track import Track
from app.core.messages import Message, Particles, Transition
from app.core.task_name import recorded
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.experiments.probe import Belief
from app.discovery.experiments.probe_pushes import Probe
from app.jobs.probed import belief, next_probe, probe_motion, probed_subject, refusal
from app.perception.body.resample_to_count import resample_to
from app.recording.write.file import EpisodeFile
from app.rig.simulated.push_session import PushSample, PushSession, StampedSnapshot
from app.tasks.elements.base import Task

_REJECTIONS = 20
"""Rejected pushes in a row after which an experiment ends with an error."""


@final
class ProbedCell:
    """The simulated cell, whose pushes are chosen.

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
        self._world = PushSession(session.task, session.plan, session.physics, session.hidden, session.seed)
        self._scribe = Scribe(session, Stopwatch())
        self._made, self._draws = list[Push](), 0

    @property
    def recordings(self) -> list[Path]:
        """The episodes so far."""
        return [self.session.path(episode) for episode in range(-(-self._world.number // self.session.plan.pushes))]

    def play(self, held: Belief, pushes: int) -> None:
        """The next episode of so many pushes, recorded, each chosen for its information.

        Raises UsageError where every push is rejected, PerceptionError where the object cannot be seen any more,
        RecordingError where the file cannot be written.
        """
        file: EpisodeFile | None = None
        try:
            for _ in range(pushes):
                look = self._world.look()
                file = file or begun_file(self.session, self._world.episode, look.stamp_s)
                held = self._push(file, look, held)
        except (OSError, RuntimeError) as error:
            raise RecordingError(f"Cannot write to {self.session.folder}: {error}; choose another with -o.") from error
        finally:
            if file is not None:
                file.close()

    def _push(self, file: EpisodeFile, look: StampedSnapshot, held: Belief) -> Belief:
        """See, choose, ask, make, see; the belief once this push is expected."""
        number, episode = self._world.number, self._world.episode
        before, messages = self._scribe.before(look, number)
        _write(file, messages)
        seen = self._view(before)
        command, held = self._approved_push(seen, episode, held)
        take = self._world.push(command)
        told = self._scribe.after(before, take, number)
        _write(file, told)
        self._made.append(self._seen_push(seen, take, told))
        return held

    def _approved_push(self, seen: ProjectionView, episode: int, held: Belief) -> tuple[Track, Belief]:
        """An approved push, and the belief expected after it. Raises UsageError if none is approved."""
        while self._asked:
            track = self._aim_push(self._asked.pop(0), seen)
            if track is not None and self._approve("A push that you asked for"):
                return track, held
        for _ in range(_REJECTIONS):
            try:
                probe = self._chosen(seen, episode, held)
            except PlanningError:
                home = self._home()
                if self._approve("A random push, as no other brings the rope back to where it can be pushed"):
                    return home, held
                continue
            if self._approve(probe.text):
                return probe.track, held.expecting(probe.information)
        raise UsageError(f"{_REJECTIONS} pushes were rejected in a row; what is recorded is kept.")

    def _chosen(self, seen: ProjectionView, episode: int, held: Belief) -> Probe:
        self._draws += 1
        seed = int(np.random.default_rng([self.session.seed, self._draws]).integers(2**31))
        plan = self.session.plan
        return next_probe(self._task.name, held, seen, episode, self._made, plan, seed, self._site)

    def _home(self) -> Track:
        """A random push, most of which go towards the middle. Raises PlanningError where it may not be made."""
        track = self._world.random()
        why = refusal(probe_motion(self._task, track, self._site), self._site)
        if why:
            raise PlanningError(f"The rope lies where no push may be made: {why}")
        return track

    def _aim_push(self, track: Track, seen: ProjectionView) -> Track | None:
        """A push that was asked for, moved to where the object is; None where it does not fit, or may not be made."""
        from app.jobs.suggested_push import aim_at
        from app.planner.actions.actions import Pushes

        assert isinstance(self._task.actions, Pushes)
        motion = probe_motion(self._task, track, self._site)
        try:
            at = aim_at(motion, seen.points, self._task.actions, self._site)
        except PlanningError:
            return None
        shift = at.positions[0] - motion.positions[0]
        late_s = seen.time_s + 0.5 - float(track.times_s[0])
        moved = replace(track, times_s=track.times_s + late_s).moved(track.positions + shift)
        return moved if refusal(probe_motion(self._task, moved, self._site), self._site) == "" else None

    def _view(self, particles: Particles) -> ProjectionView:
        return ProjectionView(time_s=particles.time_s, points=resample_to(particles.positions, self._count))

    def _seen_push(self, before: ProjectionView, take: PushSample, told: Sequence[Message]) -> Push:
        during, after = (message for message in told if isinstance(message, Particles))
        assert any(isinstance(message, Transition) for message in told)
        return Push(
            episode=take.episode,
            before=before,
            during=(self._view(during),),
            after=self._view(after),
            command=take.command,
            measured=take.measured,
        )


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
    if study is not None and study.task != recorded(task.name):
        raise UsageError(f"The recordings are of {study.task}, not of {recorded(task.name)}; name that task.")
    return belief(task.name, study)


def _write(file: EpisodeFile, messages: Sequence[Message]) -> None:
    for message in messages:
        file.write(message, now_s=message.time_s)
