"""Pushes that might be made next, and the choice of one: drawn, made safe, simulated, and weighed by `probe`.

Besides pushes drawn at random there are those that random ones miss: a push slow and fast, one that was made before at
another speed or backwards, and one through a place where something is thought to be.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias, final

import numpy as np
from jaxtyping import Float32, Float64
from threadpoolctl import threadpool_limits

from app.core.errors import PlanningError
from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.labels import label_particles
from app.discovery.dataset.model_under_test import RodModel, Subject
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.experiments.candidate_motions import push_words
from app.discovery.experiments.probe import NOTHING, Belief, gains_of, rival_words, weigh_gains
from app.discovery.inference.mixed_effects import information_of
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import residuals
from app.discovery.residuals.simulation_batch import PushParticles, SimulationBatch, prepare
from app.policy.random_pushes import REGION, PushDesign, Stroke, is_clear, midway_s, random_stroke, stroke_through

Allowed: TypeAlias = Callable[[Track], bool]
"""Predicate: the arm would make this, by the checks of every motion."""

_DRAWN: Final = 16
"""Random pushes, each slow, fast, and at a speed of its own."""
_WEIGHED: Final = 12
"""Candidates whose slopes are simulated."""
_REPEATED: Final = 3
"""Earlier pushes, the last ones, that may be made again."""
_LEAST_M: Final = 0.004
"""Least mean displacement of an informative push."""
_MARGIN_M: Final = 0.02
"""The object stays so far within the region of pushes, or it could not be pushed back."""
_NEAR_M, _ON_IT_M = 0.12, 0.02
"""A push reaches something that is this near to the object, which lies on it where it is nearer still."""
_PAUSE_S: Final = 0.5
_SAME_M_S: Final = 0.12
"""Pushes below are slow, and are made again fast; those above are made again slowly."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A push that might be made. `kind`: why it is asked for, in words that follow the push."""

    stroke: Stroke
    track: Track
    kind: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Probe:
    """The push to make next. `nats`: see `probe`; `information (S, S)`: it has about a belief's columns.

    `between`: the two rivals that it is to tell apart most.
    """

    track: Track
    text: str
    nats: float
    between: tuple[str, str]
    information: Float64[np.ndarray, "S S"]
    predicted: Points
    """The object after it, by the belief's model."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PushSituation:
    """Situation in which a push is chosen: the object as it is `seen`, in an `episode`, after those `made` before.

    `plan`: speeds and lengths of pushes, and whether the arm measures its path; `height_m`: of the tip while it pushes;
    `core_m`: from a finger's middle to an end of its core; `camera`: see `Study`; `rods`: see `label_particles`.
    """

    task: str
    seen: ProjectionView
    episode: int
    made: tuple[Push, ...]
    plan: PushDesign
    height_m: float
    allowed: Allowed
    core_m: tuple[float, float] = (0.0, 0.0)
    camera: tuple[float, float, float] = (0.55, 0.0, 0.9)
    rods: RodModel | None = None


@threadpool_limits.wrap(limits=1, user_api="blas")
def choose(subject: Subject, belief: Belief, scene: PushSituation, *, seed: int) -> Probe:
    """The push of those drawn by `seed` that is expected to say most about which rival of the belief is right.

    Raises PlanningError where none that was drawn may be made and moves the object.
    """
    predictor = Predictor(subject, subject.catalogue())
    candidates = moving(predictor, belief, scene, candidates_of(belief, scene, np.random.default_rng(seed)))
    if not candidates:
        raise PlanningError(
            "No push that was drawn may be made, moves the object and keeps it where it can be pushed; lay the object "
            "nearer to the middle of the table."
        )
    information, ends = informations(predictor, belief, scene, candidates)
    return best_of(belief, candidates, information, ends, scene.height_m)


def best_of(
    belief: Belief,
    candidates: Sequence[Candidate],
    information: Float64[np.ndarray, "K S S"],
    ends: Float32[np.ndarray, "K N 3"],
    height_m: float,
) -> Probe:
    """The candidate that is expected to say most beyond what pending pushes will."""
    gains = [weigh_gains(belief, gains_of(belief, belief.pending, belief.pending + own)) for own in information]
    best = int(np.argmax([gain.sum() for gain in gains]))
    between, nats = _told_apart(list(belief.rivals), gains[best]), float(gains[best].sum())
    candidate = candidates[best]
    first, second = (rival_words(name) for name in between)
    text = f"{push_words(candidate.track, height_m)}{candidate.kind}: to tell {first} from {second} ({nats:.2f} nats)"
    return Probe(
        track=candidate.track,
        text=text,
        nats=nats,
        between=between,
        information=information[best],
        predicted=ends[best],
    )


def candidates_of(belief: Belief, scene: PushSituation, rng: np.random.Generator) -> list[Candidate]:
    """Candidates that begin beside the object, stay in the region of pushes, and are allowed."""
    found = list[Candidate]()
    for stroke, kind in _strokes(belief, scene, rng):
        if not is_clear(stroke, scene.seen.points, scene.core_m):
            continue
        track = stroke.track(start_s=scene.seen.time_s + _PAUSE_S, height_m=scene.height_m)
        if scene.allowed(track):
            found.append(Candidate(stroke=stroke, track=track, kind=kind))
    return found


def moving(
    predictor: Predictor, belief: Belief, scene: PushSituation, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Candidates that move the object by the model, and leave it within reach: of each kind the most effective.

    None that does not; at most as many as are worth their slopes.
    """
    if not candidates:
        return []
    ends = predictor(_trials(predictor, scene, candidates, None), [belief.about]).after[0, -len(candidates) :]
    x = scene.seen.points[:, :2]
    moved_m = np.linalg.norm((ends[:, :, :2] - x).mean(1), axis=1) + np.linalg.norm(ends[:, :, :2] - x, axis=2).mean(1)
    low, high = np.array(REGION[:2]) + _MARGIN_M, np.array(REGION[2:]) - _MARGIN_M
    # An object that already reaches beyond may do so, but no farther.
    beyond = np.maximum(np.maximum(low - ends[:, :, :2], ends[:, :, :2] - high), 0.0).max((1, 2))
    already = float(np.maximum(np.maximum(low - x, x - high), 0.0).max())
    fit = np.isfinite(moved_m) & (moved_m / 2 > _LEAST_M) & (np.nan_to_num(beyond, nan=np.inf) <= already)
    kinds = dict[str, list[int]]()
    for index in sorted(np.flatnonzero(fit).tolist(), key=lambda index: -moved_m[index]):
        kinds.setdefault(candidates[index].kind.split(" as ")[0], []).append(index)
    turns = [index for turn in range(len(candidates)) for own in kinds.values() for index in own[turn : turn + 1]]
    return [candidates[index] for index in turns[:_WEIGHED]]


def informations(
    predictor: Predictor, belief: Belief, scene: PushSituation, candidates: Sequence[Candidate]
) -> tuple[Float64[np.ndarray, "K S S"], Float32[np.ndarray, "K N 3"]]:
    """Information of each candidate on the belief's columns, by its slopes about the belief's model, and its end."""
    blind = _trials(predictor, scene, candidates, None)
    expected = predictor(blind, [belief.about])
    trials = _trials(predictor, scene, candidates, PushParticles(expected.during[0], expected.after[0]))
    data = residuals(predictor, trials, belief.about, belief.steps)
    count = len(candidates)
    return information_of(data, belief.noise)[-count:], expected.after[0, -count:]


def _told_apart(names: Sequence[str], gains: Float64[np.ndarray, "C C"]) -> tuple[str, str]:
    """The pair of rivals that is discriminated most; the null hypothesis is last."""
    both = np.triu(gains + gains.T, 1)
    first, second = divmod(int(both.argmax()), len(names))
    return (names[second], names[first]) if names[first] == NOTHING else (names[first], names[second])


def _strokes(belief: Belief, scene: PushSituation, rng: np.random.Generator) -> Iterator[tuple[Stroke, str]]:
    slow, fast = scene.plan.speeds_m_s
    x = scene.seen.points
    for _ in range(_DRAWN):
        stroke = random_stroke(rng, x, scene.plan, scene.core_m)
        yield stroke, ""
        yield replace(stroke, speed_m_s=slow), ", slowly"
        yield replace(stroke, speed_m_s=fast), ", fast"
    first = len(scene.made) - min(_REPEATED, len(scene.made))
    for number, push in enumerate(scene.made[first:], first + 1):
        yield from _again(push, number, scene)
    for cause, place in belief.places:
        for speed in (slow, fast):
            stroke = _towards(place, x, scene, rng, speed)
            if stroke is not None:
                yield stroke, f", where {cause.replace('_', ' ')} may be"


def _again(push: Push, number: int, scene: PushSituation) -> Iterator[tuple[Stroke, str]]:
    """A push that was made, at the same place of the object and angle to it: at another speed, and backwards."""
    found = _touch(push, scene)
    if found is None:
        return
    along, angle, length_m, speed_m_s = found
    labels = label_particles([scene.seen.points], scene.rods)[0][0]
    at = int(np.abs(labels[:, 0] - along).argmin())
    heading = angle + float(np.arctan2(labels[at, 3], labels[at, 2]))
    ahead = np.array([np.cos(heading), np.sin(heading)])
    slow, fast = scene.plan.speeds_m_s
    other, word = (fast, "fast") if speed_m_s < _SAME_M_S else (slow, "slowly")
    through = scene.seen.points[at, :2].astype(np.float64)
    same = stroke_through(through, ahead, length_m=length_m, speed_m_s=other, core_m=scene.core_m)
    back = stroke_through(through, -ahead, length_m=length_m, speed_m_s=speed_m_s, core_m=scene.core_m)
    yield same, f", {word} again, as push {number}"
    yield back, f", backwards, as push {number}"


def _touch(push: Push, scene: PushSituation) -> tuple[float, float, float, float] | None:
    """The place along the object that a push went through, its angle to it [rad], length [m] and speed [m/s]."""
    way, times = push.command.positions, push.command.times_s
    low = np.flatnonzero(way[:, 2] < scene.height_m + 1e-3)
    if not len(low):
        return None
    steps = np.linalg.norm(np.diff(way[low, :2], axis=0), axis=1)
    going = np.flatnonzero(steps > 1e-5)
    shift = way[low[-1], :2] - way[low[0], :2]
    length_m = float(np.linalg.norm(shift))
    if not len(going) or length_m < _LEAST_M:
        return None
    ahead = shift / length_m
    offsets = push.before.points[:, :2] - way[low[0], :2]
    beside = np.abs(offsets @ np.array([-ahead[1], ahead[0]])) + 1e3 * (offsets @ ahead < 0)
    at = int(beside.argmin())
    labels = label_particles([push.before.points], scene.rods)[0][0]
    angle = float(np.arctan2(ahead[1], ahead[0]) - np.arctan2(labels[at, 3], labels[at, 2]))
    lasts_s = float(times[low][going[-1] + 1] - times[low][going[0]])
    return float(labels[at, 0]), angle, length_m, float(steps.sum()) / lasts_s


def _towards(
    place: Float64[np.ndarray, "2"], x: Points, scene: PushSituation, rng: np.random.Generator, speed_m_s: float
) -> Stroke | None:
    """A push that brings the nearest part of the object to a place, or off it; None where that is too far."""
    away = place - x[:, :2].astype(np.float64)
    distance = np.linalg.norm(away, axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] > _NEAR_M:
        return None
    ahead = away[nearest] / max(float(distance[nearest]), 1e-9)
    if distance[nearest] < _ON_IT_M:
        angle = rng.uniform(-np.pi, np.pi)
        ahead = np.array([np.cos(angle), np.sin(angle)])
    length_m = float(np.clip(distance[nearest] + 0.06, *scene.plan.lengths_m))
    through = x[nearest, :2].astype(np.float64)
    return stroke_through(through, ahead, length_m=length_m, speed_m_s=speed_m_s, core_m=scene.core_m)


def _trials(
    predictor: Predictor, scene: PushSituation, candidates: Sequence[Candidate], expected: PushParticles | None
) -> SimulationBatch:
    """The candidates as pushes whose outcome is as `expected`, or unknown.

    The last push of the same episode stands before them, where there is one, so that it is known which end is which.
    """
    before = [push for push in scene.made[-1:] if push.episode == scene.episode]
    seen = scene.seen
    pushes = [*before]
    for k, candidate in enumerate(candidates, len(before)):
        track = candidate.track
        during = seen.points if expected is None else expected.during[k]
        after = seen.points if expected is None else expected.after[k]
        pushes.append(
            Push(
                episode=scene.episode,
                before=seen,
                during=(ProjectionView(time_s=midway_s(track.times_s), points=during),) if scene.plan.during else (),
                after=ProjectionView(time_s=track.end_s, points=after),
                command=track,
                measured=track if scene.plan.measured else None,
            )
        )
    trials = prepare(Study(task=scene.task, pushes=tuple(pushes), camera=scene.camera), predictor.subject)
    # By the clock of the session the next push is the latest of all.
    latest = 0.5 if scene.made else -0.5
    return replace(trials, times=np.full(len(trials), latest))
