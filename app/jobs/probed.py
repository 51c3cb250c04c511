"""Experiments on a task: the belief from its recordings so far, and the most informative next push.

Plain functions of picklable arguments, to be run in worker processes, as `jobs`.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

from app.arm.gate import refusal
from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.scene_description import Rope
from app.perception.body.resample_to_count import resample_to

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.core.geometry.track import Track
    from app.core.motion import Motion
    from app.core.types import Points
    from app.discovery.dataset.model_under_test import Subject
    from app.discovery.dataset.study import ProjectionView, Push, Study
    from app.discovery.experiments.probe import Belief
    from app.discovery.experiments.probe_pushes import Probe, PushSituation
    from app.policy.random_pushes import PushDesign
    from app.tasks.elements.base import Task


def experiment_refusal(task: Task) -> str:
    """Why there are no experiments on a task, in a sentence; empty where there are.

    Candidates are simulated by the thousand; of other objects than rods that takes minutes a push.
    """
    from app.planner.actions.actions import Pushes

    if not isinstance(task.stage.body, Rope) or not isinstance(task.actions, Pushes):
        return f"dipac probe pushes ropes so far, and {task.problem} is another task; try rope_push."
    if task.dynamics != "rods":
        return f"dipac probe simulates ropes as rods; leave out --dynamics {task.dynamics}."
    return ""


def probed_subject(task: Task) -> Subject:
    """The simulator that experiments are about. Raises UsageError for a task without them."""
    from app.jobs.discovery_subject import subject_of

    if why := experiment_refusal(task):
        raise UsageError(why)
    return subject_of(task)


def belief(task: str, study: Study | None = None) -> Belief:
    """Belief after a study; the prior without one. Takes up to a minute."""
    from app.discovery.experiments.probe import belief_of_study, first_belief
    from app.tasks import load

    subject = probed_subject(load(task))
    return first_belief(subject) if study is None else belief_of_study(study, subject)


def next_probe(
    task: str,
    held: Belief,
    seen: ProjectionView,
    episode: int,
    made: Sequence[Push],
    plan: PushDesign,
    seed: int,
    site: Site | None = None,
) -> Probe:
    """The next push for the object as it is `seen`. Raises PlanningError where none may be made."""
    from app.discovery.experiments.probe_pushes import choose
    from app.tasks import load

    data = load(task)
    return choose(probed_subject(data), held, scene(data, seen, episode, made, plan, site or Site()), seed=seed)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Weighed:
    """Belief after some pushes, in words, and the reason to stop; empty if a further push is needed.

    `belief`: pickled, as its keeper loads neither JAX nor the simulator.
    """

    belief: bytes
    text: str
    over: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """A chosen push, in words, and the belief expected after it."""

    motion: Motion
    text: str
    then: Weighed


def belief_after(task: str, made: Sequence[Push], budget: int) -> Weighed:
    """Belief after the pushes of a session so far. Takes up to a minute."""
    from app.discovery.dataset.study import Study
    from app.discovery.experiments.probe import belief_words, stop_of, stop_words
    from app.tasks import load

    data = load(task)
    count = probed_subject(data).particle_count
    pushes = tuple(_resample(push, count) for push in made)
    held = belief(task, Study(task=data.recorded_name, pushes=pushes) if pushes else None)
    stop, words = stop_of(held, budget), belief_words(held)
    over = "" if stop is None else stop_words(held, stop)
    return Weighed(belief=pickle.dumps(held), text=f"{words[0].upper()}{words[1:]}.", over=over)


def chosen_motion(
    task: str,
    held: Weighed,
    observed: Points,
    time_s: float,
    episode: int,
    made: Sequence[Push],
    seed: int,
    site: Site,
) -> Chosen:
    """The next push for an object that is `observed` (N, 3) [m], as a motion.

    Raises PlanningError where none may be made.
    """
    from app.discovery.dataset.study import ProjectionView
    from app.policy.random_pushes import PushDesign
    from app.tasks import load

    data, known = load(task), pickle.loads(held.belief)  # noqa: S301 - our own, of `belief_after` or of this.
    count = probed_subject(data).particle_count
    pushes = tuple(_resample(push, count) for push in made)
    slowest, fastest = PushDesign().speeds_m_s
    plan = PushDesign(
        speeds_m_s=(slowest, min(fastest, site.limits.speed_m_s)),
        measured=all(push.measured is not None for push in pushes),
        during=all(push.during for push in pushes),
    )
    seen = ProjectionView(time_s=time_s, points=resample_to(observed, count))
    probe = next_probe(task, known, seen, episode, pushes, plan, seed, site)
    then = replace(held, belief=pickle.dumps(known.expecting(probe.information)))
    return Chosen(motion=probe_motion(data, probe.track, site), text=probe.text, then=then)


def _resample(push: Push, count: int) -> Push:
    """The same with as many points in each view as discovery simulates."""

    def view(seen: ProjectionView) -> ProjectionView:
        return replace(seen, points=resample_to(seen.points, count)) if len(seen.points) != count else seen

    return replace(push, before=view(push.before), during=tuple(map(view, push.during)), after=view(push.after))


def scene(
    task: Task, seen: ProjectionView, episode: int, made: Sequence[Push], plan: PushDesign, site: Site
) -> PushSituation:
    """Inputs of the choice of a push."""
    from app.discovery.experiments.probe_pushes import PushSituation

    return PushSituation(
        task=task.recorded_name,
        seen=seen,
        episode=episode,
        made=tuple(made),
        plan=plan,
        height_m=task.finger.push_height_m,
        allowed=lambda track: refusal(probe_motion(task, track, site), site) == "",
        core_m=task.finger.half_m,
        rods=probed_subject(task).rods,
    )


def probe_motion(task: Task, track: Track, site: Site) -> Motion:
    """A chosen push as a motion that the gate can check."""
    from app.jobs.suggestions.strokes import stroke_along
    from app.planner.actions.actions import Pushes

    assert isinstance(task.actions, Pushes)
    return stroke_along(track, task.actions, site)
