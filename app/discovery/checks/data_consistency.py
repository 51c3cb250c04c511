"""Data consistency of a study: tool and object far apart, clocks that disagree, another object."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import KDTree

from app.core.geometry.shapes.base import GripperFingers
from app.core.types import OPENING, Points
from app.discovery.dataset.held_part import REACH_M
from app.discovery.dataset.model_under_test import Subject
from app.discovery.dataset.names import motion_name
from app.discovery.dataset.study import Push, Study
from app.discovery.results.case import Limit
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights
from app.sim.rods.geometry.rope_size import length_of_cloud

_NEAR_M = 0.025
"""Distance from the tip to the nearest particle, from above, beyond which it touched nothing, even if cameras err."""
_MOVED_M = 0.008
"""The object has moved where so far from it there is a tenth of what was seen before: particles lie 3 mm apart."""
_TENTH = 0.9
_SLACK_S = 0.2
"""Tolerance of time stamps, above the errors of one clock; delays of this size are causes that can be named."""
_MOST, _SOME = 0.5, 0.1
_NODES = 24
_CLEAR_M = 0.005
_CLOUDS, _FEWEST_CLOUDS = 6, 4
"""Numbers of an episode's clouds that say how long its object is: at most, and at least."""
_OTHER, _DEVIATIONS = 0.08, 4.0
"""Share, and standard errors, by which an object is another one from episode to episode."""
_MEDIAN_TO_SD = 1.4826
_SAME_M = 1e-5
_LONGER, _SHORTER = 1.5, 0.5
_MILLI = 1e3


def contradictions(study: Study, subject: Subject) -> Iterator[Limit]:
    """Contradictions of each kind."""
    if subject.kind.has_length:
        yield from _size(study, subject)
    yield from same_episodes(study)
    if subject.rods is not None:
        yield from _lengths(study, subject)
    yield from _clocks(study, subject)
    if subject.fingers is None:
        yield from _contact(study, subject)
    else:
        yield from _hold(study, subject, subject.fingers)


def _size(study: Study, subject: Subject) -> Iterator[Limit]:
    """An object much longer or shorter than the task's."""
    lengths = [_length_m(push.before.points) for push in study.pushes]
    if not lengths:
        return
    # One that is coiled up touches itself and looks short: it is as long as it ever was.
    longest, usual = max(lengths), float(np.median(lengths))
    short = longest < _SHORTER * subject.length_m
    if not short and usual <= _LONGER * subject.length_m:
        return
    length = longest if short else usual
    millimetres = _SHORTER <= length / (_MILLI * subject.length_m) <= _LONGER
    yield Limit(
        text=f"The object is {length:.3g} m long, that of {study.task} {subject.length_m:g} m.",
        consequence=(
            "The clouds seem to be in millimetres, so no cause is named: give metres."
            if millimetres
            else "It is another object, only a part of one, or not in metres, so no cause is named: "
            "check what the cameras take for the object, and give data of the task's own."
        ),
        fatal=True,
    )


def same_episodes(study: Study) -> Iterator[Limit]:
    """Pushes that are in two episodes: a recording and its copy, or what was recovered of it."""
    first = dict[bytes, int]()
    for push in study.pushes:
        begin_s = push.command.times_s[0]
        told = [push.before.points / _SAME_M, push.after.points / _SAME_M, push.command.poses / _SAME_M]
        times = np.round((push.command.times_s - begin_s) / _SAME_M)
        key = b"".join(np.round(part).astype(np.int64).tobytes() for part in (*told, times))
        other = first.setdefault(key, push.episode)
        if other != push.episode:
            yield Limit(
                text=f"Episodes {other + 1} and {push.episode + 1} hold the same motion.",
                consequence=(
                    "An episode that counts twice makes everything look surer than it is, so no cause is named: leave "
                    "out copies of recordings, and what was recovered of one that is whole."
                ),
                fatal=True,
            )
            return


def _lengths(study: Study, subject: Subject) -> Iterator[Limit]:
    """An object that is longer in one episode than in the others."""
    found = dict[int, list[Points]]()
    for push in study.pushes:
        found.setdefault(push.episode, []).extend((push.before.points, push.after.points))
    lengths, errors = list[tuple[int, float]](), list[float]()
    for number, clouds in found.items():
        if len(clouds) < _FEWEST_CLOUDS:
            continue
        chosen = np.unique(np.linspace(0, len(clouds) - 1, _CLOUDS).round().astype(int))
        own = np.array([length_of_cloud(clouds[k], subject.radius_m) for k in chosen])
        lengths.append((number, float(own.max())))  # One that touches itself seems up to a half shorter, none longer.
        errors += (np.abs(own - np.median(own)) / np.sqrt(len(own))).tolist()
    if len(lengths) < 2:
        return
    usual = float(np.median([length for _, length in lengths]))
    least = max(_OTHER * usual, _DEVIATIONS * _MEDIAN_TO_SD * float(np.median(errors)))
    number, length = max(lengths, key=lambda pair: abs(pair[1] - usual))
    if abs(length - usual) > least:
        yield Limit(
            text=(
                f"The object is {_MILLI * length:.0f} mm long in episode {number + 1}, and {_MILLI * usual:.0f} mm "
                "in a usual one."
            ),
            consequence=(
                "It is another object there, or only a part of it is seen, so no cause is named: give recordings of "
                "one object at a time."
            ),
            fatal=True,
        )


def _length_m(x: Points) -> float:
    """Length along the middle of a cloud, or across it if it is no rope on a table."""
    across = float(np.linalg.norm(np.ptp(x, axis=0)))
    nodes = centreline_weights(arclength_labels(x), _NODES) @ x
    along = float(np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()) * _NODES / (_NODES - 1)
    return max(across, along)


def _clocks(study: Study, subject: Subject) -> Iterator[Limit]:
    pushes = study.pushes
    backward = [number for number, push in enumerate(pushes, 1) if _runs_back(push)]
    if backward:
        yield Limit(
            text=f"Time runs backwards in {_of(backward, len(pushes), subject)}.",
            consequence=(
                "No motion can be simulated from such times, so no cause is named: date views and poses by one clock "
                "that is never set, and give each motion a view before and one after it."
            ),
            fatal=True,
        )
        return
    outside = [number for number, push in enumerate(pushes, 1) if _outside(push, subject.low_m)]
    if outside:
        yield Limit(
            text=(
                "Views that should be before, during or after the motion are not in "
                f"{_of(outside, len(pushes), subject)}."
            ),
            consequence=(
                "The cameras' clock and the arm's disagree by more than 0.2 s, or views are of another motion; delays "
                "cannot be believed: date both by one clock."
            ),
            fatal=len(outside) > _MOST * len(pushes),
        )
    seen = [number for number, push in enumerate(pushes, 1) if push.during]
    early = [number for number in seen if _moved_early(pushes[number - 1], subject)]
    if len(early) > _SOME * len(seen):
        yield Limit(
            text=f"The object moved before the tool could touch it in {_of(early, len(seen), subject)}.",
            consequence=(
                "The cameras' clock runs ahead of the arm's by more than 0.2 s, or something else moves the object; "
                "delays and lags cannot be believed: date views and poses by one clock."
            ),
            fatal=len(early) > _MOST * len(seen),
        )


def _runs_back(push: Push) -> bool:
    tracks = [push.command, *([push.measured] if push.measured else [])]
    return push.after.time_s <= push.before.time_s or any(np.any(np.diff(track.times_s) <= 0) for track in tracks)


def _outside(push: Push, low_m: float) -> bool:
    """True if a view is at the wrong time of its push."""
    times = push.track.times_s
    low = times[push.track.poses[:, 2] < low_m]
    first, last = (low[0], low[-1]) if len(low) else (times[-1], times[0])
    during = [times[0] - _SLACK_S <= view.time_s <= times[-1] + _SLACK_S for view in push.during]
    return bool(not all(during) or push.before.time_s > first + _SLACK_S or push.after.time_s < last - _SLACK_S)


def _moved_early(push: Push, subject: Subject) -> bool:
    """True if a view shows the object moved before the tool had come near it, as it did later."""
    if not _came_near(push, subject):
        return False
    for view in push.during:
        low = (push.track.poses[:, 2] < subject.low_m) & (push.track.times_s <= view.time_s + _SLACK_S)
        near = low.any() and _gap_m(push.before.points, push.track.positions[low]) < _NEAR_M
        if not near and _moved_m(push.before.points, view.points) > _MOVED_M:
            return True
    return False


def _contact(study: Study, subject: Subject) -> Iterator[Limit]:
    pushes = study.pushes
    if not pushes:
        return
    motions = motion_name(subject.kind.name, count=len(pushes))
    touched = np.array([_came_near(push, subject) for push in pushes])
    moved = np.array([_moved_m(push.before.points, push.after.points) > _MOVED_M for push in pushes])
    if touched.any():
        if not touched.all():
            only = "only " if touched.mean() < _MOST else ""
            yield Limit(
                text=f"The tool came near the object in {only}{touched.sum()} of {len(pushes)} {motions}.",
                consequence=f"The others teach nothing about the object: plan {motions} through it.",
            )
        return
    near = f"{_MILLI * _reach_m(subject):.0f} mm"
    yield Limit(
        text=(
            f"The object moved, but the tool never came within {near} of it."
            if moved.any()
            else f"The tool never came within {near} of the object, and nothing moved."
        ),
        consequence=(
            "Tool and object are not in the same frame, or their clocks disagree, so no cause is named: give both in "
            "metres in the robot's base frame, z up from the table."
            if moved.any()
            else "Motions that touch nothing say nothing about the object, so no cause is named: "
            + _how_to_touch(subject)
        ),
        fatal=True,
    )


def _hold(study: Study, subject: Subject, fingers: GripperFingers) -> Iterator[Limit]:
    """Motions in which the gripper does not hold the object from where it closed on to the end."""
    pushes = study.pushes
    lost = [number for number, push in enumerate(pushes, 1) if not _holds(push, fingers)]
    if not lost:
        return
    consequence, fatal = "They teach nothing about the object", len(lost) > _SOME * len(pushes)
    yield Limit(
        text=(
            f"The gripper is open, or farther than {_MILLI * REACH_M:.0f} mm from the object, in "
            f"{_of(lost, len(pushes), subject)}."
        ),
        consequence=f"{consequence}{', so no cause is named' if fatal else ''}: keep it in the gripper from the first "
        "motion of an episode to the last.",
        fatal=fatal,
    )


def _holds(push: Push, fingers: GripperFingers) -> bool:
    """True if the gripper closes near the object, or is closed from the first, and stays closed to the end."""
    poses = push.track.poses
    closed = poses[:, OPENING] <= fingers.closed_m
    first = int(np.argmax(closed))
    away_m, _ = KDTree(push.before.points).query(poses[first, :3])
    return bool(closed[first:].all() and away_m <= REACH_M)


def _how_to_touch(subject: Subject) -> str:
    if subject.kind.is_poured:
        return "begin each motion with the liquid in the bowl that is held, and pour."
    return f"push through it, with the tip lower than {_MILLI * subject.low_m:.0f} mm over the table."


def _came_near(push: Push, subject: Subject) -> bool:
    low = push.track.poses[:, 2] < subject.low_m
    return bool(low.any()) and _gap_m(push.before.points, push.track.positions[low]) < _reach_m(subject)


def _reach_m(subject: Subject) -> float:
    """Distance of contact: `_NEAR_M`, or more if the tool or the object is larger."""
    finger, paddle_half_m = subject.finger, subject.paddle_half_m
    if paddle_half_m is not None:
        tool_m = float(np.hypot(*paddle_half_m))
    elif finger is not None:
        tool_m = finger.radius_m + finger.half_width_m
    else:
        return _NEAR_M
    return max(_NEAR_M, tool_m + subject.radius_m + _CLEAR_M)


def _gap_m(x: Points, tips: np.ndarray) -> float:
    """The least distance of tips from particles, seen from above [m]."""
    return float(np.min(KDTree(x[:, :2]).query(tips[:, :2])[0]))


def _moved_m(before: Points, after: Points) -> float:
    """Displacement of the farthest tenth of the object from its former shape, seen from above [m]."""
    return float(np.quantile(KDTree(before[:, :2]).query(after[:, :2])[0], _TENTH))


def _of(numbers: list[int], count: int, subject: Subject) -> str:
    """Text about some of `count` motions, with the number of the first."""
    return f"{len(numbers)} of {count} {motion_name(subject.kind.name, count=count)} (the first is number {numbers[0]})"
