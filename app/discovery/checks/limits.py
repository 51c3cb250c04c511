"""Deficiencies of a study, and the conclusions that they prevent: stated before any.

A single cause of typical size takes about 6 episodes and 40 pushes at three speeds or more, in four directions or more,
with a view in the middle of each push; mixtures take about twice that. The thresholds here are lower: below them, the
sentences say what will be missed.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64

from app.discovery.checks.data_consistency import contradictions
from app.discovery.dataset.model_under_test import Subject
from app.discovery.dataset.names import motion_name
from app.discovery.dataset.study import Push, Study
from app.discovery.results.case import Limit

_EPISODES, _FEWEST_EPISODES = 4, 2
_PUSHES, _FEWEST_PUSHES = 12, 6
_SPEED_RATIO = 1.3
_MOVING_M_S = 0.01
_DIRECTIONS, _APART_RAD = 4, np.radians(30.0)
_FEWEST_DIRECTIONS = 2
_MOST = 0.5


def limits_of(study: Study, subject: Subject) -> tuple[Limit, ...]:
    """Deficiencies that narrow or forbid a conclusion; none if the study is good."""
    return (
        *_amount(study, subject),
        *_setup_limits(study),
        *contradictions(study, subject),
        *_variety(study, subject),
        *_instruments(study, subject),
    )


def _setup_limits(study: Study) -> Iterator[Limit]:
    """Flaws of imported data about object, tool and table, and quantities in them that say nothing of cameras."""
    setup = study.setup
    if setup is None:
        return
    for flaw in setup.flaws:
        yield Limit(
            text=flaw,
            consequence="What is simulated is not what was there, so no cause is named: mend it, or give other data.",
            fatal=True,
        )
    if setup.table.taken_out:
        yield Limit(
            text=(
                f"The table was {setup.table.height_m:.3f} m high in the data and tilted by "
                f"{setup.table.tilt_deg:.1f} degrees."
            ),
            consequence=(
                "That is taken for where it is, so it says nothing of a depth camera's bias or of cameras that are "
                "turned: give data in which the table is at height 0 to have them checked with it."
            ),
        )
    if setup.tool_points == "surface" and "task" in (
        setup.source("finger_radius_m"),
        setup.source("finger_half_width_m"),
    ):
        yield Limit(
            text="Points of the tool were seen, but neither they nor about say how large it is.",
            consequence="So they do not say where it is, and cameras are not checked with it: give tool.radius_m.",
        )


def _amount(study: Study, subject: Subject) -> Iterator[Limit]:
    episodes, pushes = len({push.episode for push in study.pushes}), len(study.pushes)
    motion, motions = motion_name(subject.kind.name), motion_name(subject.kind.name, count=2)
    if episodes < _EPISODES:
        fatal = episodes < _FEWEST_EPISODES
        yield Limit(
            text=f"There {_are(episodes, 'episode', 'episodes')}; {_EPISODES} are asked for, 6 are better.",
            consequence=(
                f"Whether a cause explains {motions} that it was not fitted to cannot be tested, so none is named: "
                "record further episodes, each from another shape of the object."
                if fatal
                else "What holds for one episode by chance may be taken for a cause, and intervals are wide: record "
                "further episodes, each from another shape of the object."
            ),
            fatal=fatal,
        )
    if pushes < _PUSHES:
        fatal = pushes < _FEWEST_PUSHES
        yield Limit(
            text=f"There {_are(pushes, motion, motions)}; {_PUSHES} are asked for, 40 are better.",
            consequence=(
                "They are fewer than the causes to choose from, so none is named: record 6 or more an episode."
                if fatal
                else "Only large effects show, and like ones stay together: record 6 or more an episode."
            ),
            fatal=fatal,
        )


def _variety(study: Study, subject: Subject) -> Iterator[Limit]:
    motions = motion_name(subject.kind.name, count=2)
    low = [way for push in study.pushes if len(way := _low_way(push, subject.low_m))]
    speeds = [speed for way in low if (speed := _speed(way)) > 0]
    if speeds and max(speeds) < _SPEED_RATIO * min(speeds):
        yield Limit(
            text=f"All {motions} are equally fast ({_span(min(speeds), max(speeds))}).",
            consequence=(
                "command_delay, tool_compliance, stribeck and viscous_film cannot be told apart: what they do differs "
                "by speed. Move at three speeds next time, for example 0.05, 0.12 and 0.30 m/s."
            ),
        )
    directions = _directions(low)
    if low and directions < _DIRECTIONS:
        yield Limit(
            text=f"The {motions} go in {_count_text(directions)}; {_DIRECTIONS} are asked for.",
            consequence=(
                "table_tilt, hand_eye_translation, tcp_offset, friction_anisotropy and draught look alike along one "
                "line, and what they do across it does not show. Come from all sides next time."
                + (" No cause is named." if directions < _FEWEST_DIRECTIONS else "")
            ),
            fatal=directions < _FEWEST_DIRECTIONS,
        )


def _instruments(study: Study, subject: Subject) -> Iterator[Limit]:
    pushes, motion = study.pushes, motion_name(subject.kind.name)
    motions = motion_name(subject.kind.name, count=len(pushes))
    seen = sum(bool(push.during) for push in pushes)
    if seen < _MOST * len(pushes):
        yield Limit(
            text=(
                "The object was seen only after it had come to rest"
                + (f", but for {seen} of {len(pushes)} {motions}." if seen else f", never during a {motion}.")
            ),
            consequence=(
                "Delays and lags are invisible (command_delay, actuator_lag, camera_time_offset, kelvin_voigt), and "
                "there is no tool in view to check the cameras with: keep them on while the tool moves, one view in "
                f"the later half of each {motion} at least."
            ),
        )
    measured = sum(push.measured is not None for push in pushes)
    if measured < _MOST * len(pushes):
        yield Limit(
            text=f"Where the tool really went was measured in {measured} of {len(pushes)} {motions}.",
            consequence=(
                "An arm that does not do what it is told (command_delay, actuator_lag, under_reach, tool_compliance, "
                "backlash) cannot be told from physics: record the measured poses of the arm beside the commanded."
            ),
        )
    if seen and not any(view.finger is not None for push in pushes for view in push.during):
        yield Limit(
            text=f"The tool was not seen during any {motion}.",
            consequence=(
                "A camera out of place (hand_eye_translation, hand_eye_rotation), one out of time (camera_time_offset) "
                "and a tool tip that is not where the kinematics have it (tcp_offset) rest on the object's shape "
                "alone: record points of the tool in the same images."
            ),
        )
    if not study.tables:
        yield Limit(
            text="The bare table was not seen.",
            consequence=(
                "A depth camera's scale and bias, and cameras that are turned (depth_scale, depth_bias, "
                "hand_eye_rotation), are hard to see: record points of the bare table once an episode."
            ),
        )


def _low_way(push: Push, low_m: float) -> Float64[np.ndarray, "T 3"]:
    """Time [s] and x, y [m] of the tool where it is low enough to touch."""
    track = push.track
    low = track.poses[:, 2] < low_m
    return np.column_stack([track.times_s[low], track.positions[low, :2]])


def _speed(way: Float64[np.ndarray, "T 3"]) -> float:
    """The usual speed [m/s] while it moves; 0 where it never does."""
    steps = np.diff(way, axis=0)
    speeds = np.linalg.norm(steps[:, 1:], axis=1) / np.maximum(steps[:, 0], np.finfo(float).tiny)
    moving = speeds[speeds > _MOVING_M_S]
    return float(np.median(moving)) if len(moving) else 0.0


def _directions(ways: list[Float64[np.ndarray, "_ 3"]]) -> int:
    """Number of directions, each 30 degrees or more from the next, around the circle."""
    ends = np.array([way[-1, 1:] - way[0, 1:] for way in ways]).reshape(-1, 2)
    ends = ends[np.linalg.norm(ends, axis=1) > 0]
    angles = np.sort(np.arctan2(ends[:, 1], ends[:, 0]))
    if not len(angles):
        return 0
    taken = [angles[0]]
    for angle in angles[1:]:
        if angle - taken[-1] >= _APART_RAD and taken[0] + 2 * np.pi - angle >= _APART_RAD:
            taken.append(angle)
    return len(taken)


def _span(low: float, high: float) -> str:
    return f"{low:.2f} m/s" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} to {high:.2f} m/s"


def _count_text(directions: int) -> str:
    return "1 direction" if directions == 1 else f"{directions} directions"


def _are(count: int, noun: str, plural: str) -> str:
    return f"is 1 {noun}" if count == 1 else f"are {count} {plural}"
