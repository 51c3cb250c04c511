"""Limits of a study are stated, with what to do next time; a good study has none."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.core.geometry.track import Track
from app.discovery.checks.data_consistency import contradictions
from app.discovery.checks.limits import limits_of
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.results.case import Limit
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign, midway_s, random_track
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push")
SUBJECT = subject_of(TASK)
MOVED = np.array([0.02, 0.01, 0.0], np.float32)


def good() -> Study:
    """Six episodes of six pushes, whose clouds move as a whole when they are pushed."""
    rng, pushes, now_s = np.random.default_rng(0), list[Push](), 0.0
    for number in range(36):
        x = fill_tube(TASK.start(number // 6), TASK.rope.radius_m, 300)
        command = random_track(rng, x, PushDesign(), start_s=now_s + 0.5, height_m=TASK.finger.push_height_m)
        at = midway_s(command.times_s)
        finger = (command.at(np.array([at])) + rng.normal(0, 1e-3, (60, 3))).astype(np.float32)
        now_s = float(command.times_s[-1]) + 0.5
        pushes.append(
            Push(
                episode=number // 6,
                before=ProjectionView(time_s=now_s - 0.5 - float(np.ptp(command.times_s)), points=x),
                during=(ProjectionView(time_s=at, points=x + MOVED / 2, finger=finger),),
                after=ProjectionView(time_s=now_s, points=x + MOVED),
                command=command,
                measured=command,
            )
        )
    return Study(task="rope_push", pushes=tuple(pushes), tables={n: np.zeros((40, 3), np.float32) for n in range(6)})


GOOD = good()


def limits(study: Study) -> list[Limit]:
    return list(limits_of(study, SUBJECT))


def each(change: Callable[[Push], Push]) -> Study:
    """The good study with every push changed."""
    return replace(GOOD, pushes=tuple(map(change, GOOD.pushes)))


def some(every: int, change: Callable[[Push], Push]) -> Study:
    """The good study with every `every`-th push changed."""
    return replace(GOOD, pushes=tuple(change(push) if n % every == 0 else push for n, push in enumerate(GOOD.pushes)))


def first(count: int, *, an_episode: int = 6) -> Study:
    pushes = [push for n, push in enumerate(GOOD.pushes) if n % 6 < an_episode]
    return replace(GOOD, pushes=tuple(pushes[:count]))


def along(push: Push, angle: float) -> Push:
    """A push through the middle of the object in this direction."""
    middle, ahead = push.before.points.mean(0)[:2], np.array([np.cos(angle), np.sin(angle)])
    nearest = push.before.points[np.argmin(np.linalg.norm(push.before.points[:, :2] - middle, axis=1)), :2]
    poses, low = push.command.poses.copy(), push.command.poses[:, 2] < SUBJECT.low_m
    way = np.linspace(-0.04, 0.06, low.sum())[:, None] * ahead + nearest
    poses[low, :2] = way
    poses[: np.argmax(low), :2], poses[len(low) - np.argmax(low[::-1]) :, :2] = way[0], way[-1]
    return with_track(push, replace(push.command, poses=poses))


def with_track(push: Push, track: Track) -> Push:
    return replace(push, command=track, measured=track)


def at_speed(push: Push, speed_m_s: float) -> Push:
    """The same path at one constant speed."""
    steps = np.linalg.norm(np.diff(push.command.positions[:, :2], axis=0), axis=1)
    times = push.command.times_s[0] + np.concatenate([[0.0], np.cumsum(np.maximum(steps / speed_m_s, 0.005))])
    moved = with_track(push, replace(push.command, times_s=times))
    during = tuple(replace(view, time_s=midway_s(moved.command.times_s)) for view in push.during)
    return replace(
        moved,
        before=replace(push.before, time_s=float(times[0])),
        during=during,
        after=replace(push.after, time_s=float(times[-1])),
    )


def seen(push: Push, **values: Any) -> Push:
    """A push with its view during the motion changed."""
    return replace(push, during=tuple(replace(view, **values) for view in push.during))


def aside(push: Push) -> Push:
    """A push whose tool is half a metre from the object."""
    poses = push.command.poses + np.array([0.5, 0, 0, 0, 0, 0, 0])
    return with_track(push, replace(push.command, poses=poses))


def unmoved(push: Push) -> Push:
    x = push.before.points
    return seen(replace(push, after=replace(push.after, points=x)), points=x)


def scaled(push: Push, by: float) -> Push:
    def view(of: ProjectionView) -> ProjectionView:
        return replace(of, points=(of.points * by).astype(np.float32))

    return replace(push, before=view(push.before), during=tuple(map(view, push.during)), after=view(push.after))


def set_back(push: Push) -> Push:
    times = push.command.times_s.copy()
    times[50:] -= 1.0
    return replace(push, command=replace(push.command, times_s=times))


def test_of_a_good_study_nothing_is_said() -> None:
    assert limits(GOOD) == []


BROKEN: dict[str, tuple[Study, str, str, bool]] = {
    "three episodes": (first(18), "There are 3 episodes", "another shape", False),
    "one episode": (
        replace(GOOD, pushes=tuple(replace(push, episode=0) for push in GOOD.pushes)),
        "There is 1 episode",
        "none is named",
        True,
    ),
    "eight pushes": (first(8, an_episode=2), "There are 8 pushes", "like ones stay together", False),
    "one speed": (each(lambda p: at_speed(p, 0.15)), "equally fast (0.15 m/s)", "stribeck and viscous_film", False),
    "two directions": (some(1, lambda p: along(p, np.pi * (p.episode % 2))), "in 2 directions", "table_tilt", False),
    "one direction": (each(lambda p: along(p, 0.3)), "in 1 direction", "No cause is named", True),
    "a copy of an episode": (
        replace(GOOD, pushes=(*GOOD.pushes, *(replace(p, episode=p.episode + 6) for p in GOOD.pushes[:4]))),
        "Episodes 1 and 7 hold the same motion",
        "leave out copies",
        True,
    ),
    "some contact": (some(9, lambda p: unmoved(aside(p))), "in 32 of 36", "through it", False),
    "no contact": (each(lambda p: unmoved(aside(p))), "never came within 25 mm", "push through it", True),
    "frames that disagree": (each(aside), "moved, but the tool never came", "same frame", True),
    "little contact": (
        some(1, lambda p: p if p.episode < 2 else unmoved(aside(p))),
        "only 12 of 36",
        "through it",
        False,
    ),
    "no views on the way": (each(lambda p: replace(p, during=())), "never during a push", "Delays and lags", False),
    "no log of the arm": (each(lambda p: replace(p, measured=None)), "measured in 0 of 36", "actuator_lag", False),
    "no finger": (each(lambda p: seen(p, finger=None)), "The tool was not seen", "tcp_offset", False),
    "no table": (replace(GOOD, tables={}), "The bare table was not seen", "depth_scale", False),
    "a clock set back": (some(9, set_back), "Time runs backwards in 4 of 36 pushes", "one clock", True),
    "views after the motion": (
        some(9, lambda p: seen(p, time_s=float(p.command.times_s[-1]) + 3.0)),
        "are not in 4 of 36",
        "cameras' clock and the arm's",
        False,
    ),
    "movement before contact": (
        some(4, lambda p: seen(p, time_s=float(p.command.times_s[0]))),
        "before the tool could touch it in 9 of 36",
        "runs ahead",
        False,
    ),
    "millimetres": (each(lambda p: scaled(p, 1e3)), "m long, that of rope_push 0.4 m", "millimetres", True),
    "half a rope": (each(lambda p: scaled(p, 0.3)), "m long, that of rope_push 0.4 m", "another object", True),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_wrong_is_said_with_what_follows_from_it(name: str) -> None:
    study, text, consequence, fatal = BROKEN[name]
    said = [limit for limit in limits(study) if text in limit.text]
    assert len(said) == 1
    assert consequence in said[0].consequence
    assert said[0].fatal == fatal


@pytest.mark.parametrize("name", [name for name in BROKEN if name not in ("millimetres", "half a rope")])
def test_one_thing_that_is_wrong_is_one_limit(name: str) -> None:
    also = {"little contact": 1, "movement before contact": 1}
    assert len(limits(BROKEN[name][0])) <= also.get(name, 1)


def test_nothing_at_all_is_fatal() -> None:
    assert any(limit.fatal for limit in limits(replace(GOOD, pushes=())))


def test_an_object_that_is_coiled_up_now_and_then_is_not_another_one() -> None:
    coiled = limits(some(2, coiled_up))
    assert not any("long" in limit.text for limit in coiled)
    assert any("long" in limit.text for limit in limits(each(coiled_up)))


def coiled_up(push: Push) -> Push:
    """A push of an object coiled up in a ring of half its length: it touches itself and looks short."""
    turn = np.linspace(0, 4 * np.pi, 200)
    ring = np.stack([0.05 * np.cos(turn), 0.05 * np.sin(turn), np.zeros(200)], 1) + push.before.points.mean(0)
    x = fill_tube(ring, TASK.rope.radius_m, 300)
    return replace(push, before=replace(push.before, points=x), after=replace(push.after, points=x + MOVED))


def test_to_those_who_pour_nothing_is_said_of_pushes_with_a_tip() -> None:
    far = each(lambda push: unmoved(aside(push)))
    (fatal,) = [limit for limit in contradictions(far, subject_of(load("pour_water"))) if limit.fatal]
    assert "never came within" in fatal.text
    assert "begin each motion with the liquid in the bowl that is held" in fatal.consequence
    assert "tip" not in fatal.consequence
