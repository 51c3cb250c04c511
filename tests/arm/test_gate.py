"""The gate lets through what keeps the limits and nothing else, as an oracle sees it that shares no code with it."""

import dataclasses
import itertools
import math
from collections import Counter

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.arm.gate import MAX_WAYPOINTS, begin
from app.config import KeepOut, Limits, Reach, Site
from app.core.errors import MotionRefused
from app.core.motion import TOOL_DOWN, Motion, pointing_down
from app.core.rejection_codes import Refusal
from app.core.types import ToolPose
from app.rig.simulated.arm_control import ArmControl

COMMANDS = 10_000
TICK_S = 0.01
STAND = KeepOut(name="camera stand", low=(0.60, 0.10, 0.0), high=(0.70, 0.20, 0.40))
CUP = KeepOut(name="cup", low=(0.40, -0.25, 0.0), high=(0.46, -0.19, 0.10))
REACH = Reach(middle=(0.0, 0.0, 0.3), radius_m=0.8, hand_m=0.25)
SITE = Site(limits=Limits(keep_out=(STAND, CUP), reach=REACH))
BOX = SITE.limits.workspace
COUNTS = {0: 0.01, 1: 0.2, 2: 0.35, 3: 0.2, 5: 0.2, 20: 0.02, MAX_WAYPOINTS: 0.01, MAX_WAYPOINTS + 1: 0.01}
"""Numbers of positions in a motion, with the probability of each."""
ODD = [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-308, 0.0, -0.0]
"""Numbers that programs send by mistake."""


def around(rng: np.random.Generator, low: float, high: float) -> float:
    """A number within the range as a rule; else one at an end of it or just beyond, or not a finite number."""
    kind = rng.random()
    if kind < 0.9:
        return float(rng.uniform(low, high))
    if kind < 0.97:
        return float(rng.choice([low, high])) + float(rng.choice([0.0, 1e-7, -1e-7, 1e-3, -1e-3]))
    return float(rng.choice(ODD))


def place(rng: np.random.Generator) -> list[float]:
    """A place in the workspace as a rule, sometimes on a face of a keep-out volume."""
    if rng.random() < 0.05:
        volume = (STAND, CUP)[rng.integers(2)]
        corner = [float(rng.choice([low, high])) for low, high in zip(volume.low, volume.high, strict=True)]
        return [value + float(rng.choice([1e-6, -1e-6, 1e-3, -1e-3])) for value in corner]
    return [around(rng, low, high) for low, high in zip(BOX.low, BOX.high, strict=True)]


def command(rng: np.random.Generator) -> Motion:
    """A motion of a few positions, right in most of its numbers; half of all are right in all of them."""
    count = int(
        rng.choice(
            [0, 1, 2, 3, 5, 20, MAX_WAYPOINTS, MAX_WAYPOINTS + 1], p=[0.01, 0.2, 0.35, 0.2, 0.2, 0.02, 0.01, 0.01]
        )
    )
    careful = rng.random() < 0.5
    middle = rng.uniform(BOX.low, BOX.high)
    positions = np.array([place(rng) for _ in range(count)]).reshape(-1, 3)
    if careful:
        near = middle + rng.normal(0, 0.03, (count, 3))
        positions = np.clip(near, np.array(BOX.low) + 1e-9, np.array(BOX.high) - 1e-9)
    speeds = np.array([0.2 if careful else around(rng, 0.0, SITE.limits.speed_m_s) for _ in range(count)])
    motion = Motion(positions=positions, speeds=speeds)
    if rng.random() < 0.3:
        turns = rng.normal(size=(count, 4))
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        if not careful and rng.random() < 0.3:
            turns *= float(rng.choice([0.0, 0.5, 1.001, np.nan]))
        motion = dataclasses.replace(motion, turns=turns)
    if rng.random() < 0.3:
        most = SITE.limits.opening_m
        openings = np.array([rng.uniform(0, most) if careful else around(rng, 0.0, most) for _ in range(count)])
        motion = dataclasses.replace(motion, openings=openings)
    if not careful and rng.random() < 0.05:
        motion = dataclasses.replace(motion, openings=np.zeros(count + 1))
    return dataclasses.replace(motion, continues=bool(rng.random() < 0.1))


def crosses(start: list[float], end: list[float], volume: KeepOut) -> bool:
    """True if a line segment enters a box: separating axes, Gottschalk, Lin and Manocha 1996."""
    half = [(high - low) / 2 for low, high in zip(volume.low, volume.high, strict=True)]
    middle = [(high + low) / 2 for low, high in zip(volume.low, volume.high, strict=True)]
    centre = [(a + b) / 2 - m for a, b, m in zip(start, end, middle, strict=True)]
    reach = [(b - a) / 2 for a, b in zip(start, end, strict=True)]
    for axis in range(3):
        if abs(centre[axis]) >= half[axis] + abs(reach[axis]):
            return False
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        if all(value == 0 for value in (reach[one], reach[two])):
            continue
        apart = abs(reach[one] * centre[two] - reach[two] * centre[one])
        if apart >= half[one] * abs(reach[two]) + half[two] * abs(reach[one]):
            return False
    return True


def along(motion: Motion, tool: ToolPose) -> list[list[float]]:
    """Position [m] and turn (quaternion) of the tool at all points of its path, as plain numbers."""
    turns = motion.turns.tolist() or [list(TOOL_DOWN)] * len(motion.positions)
    told = [[*row, *turn] for row, turn in zip(motion.positions.tolist(), turns, strict=True)]
    here = tool.tolist()[:7]
    if motion.continues:
        return [here, *told]
    high = [[*row[:2], max(row[2], SITE.travel_height_m), *row[3:]] for row in (here, told[0], told[-1])]
    return [here, *high, *told]


def reached_m(pose: list[float]) -> float:
    """Distance from the shoulder to the wrist [m]; SciPy turns the offset from tip to wrist."""
    back = Rotation.from_quat(pose[3:], scalar_first=True).apply([0.0, 0.0, -REACH.hand_m]).tolist()
    return math.dist([tip + to for tip, to in zip(pose[:3], back, strict=True)], REACH.middle)


def broken(motion: Motion, tool: ToolPose) -> set[Refusal]:
    """Every rule that the motion breaks, read off its plain numbers."""
    positions, speeds = motion.positions.tolist(), motion.speeds.tolist()
    turns, openings = motion.turns.tolist(), motion.openings.tolist()
    count, rules = len(positions), set[Refusal]()
    counted = len(speeds) == count and len(turns) in (0, count) and len(openings) in (0, count)
    if not 1 <= count <= MAX_WAYPOINTS or not counted:
        return {Refusal.SHAPE}
    numbers = [*speeds, *openings, *(value for row in (*positions, *turns) for value in row)]
    if not all(map(math.isfinite, numbers)):
        return {Refusal.NOT_FINITE}
    if any(
        not low <= value <= high for row in positions for value, low, high in zip(row, BOX.low, BOX.high, strict=True)
    ):
        rules.add(Refusal.OUTSIDE)
    if any(not 0 < value <= SITE.limits.speed_m_s * (1 + 1e-9) for value in speeds):
        rules.add(Refusal.SPEED)
    if any(abs(math.hypot(*row) - 1) >= 1e-6 for row in turns):
        rules.add(Refusal.TOOL)
    if any(not 0 <= value <= SITE.limits.opening_m for value in openings):
        rules.add(Refusal.TOOL)
    first, last, here = positions[0], positions[-1], tool[:3].tolist()
    if motion.continues:
        if math.dist(first, here) > 0.005:
            rules.add(Refusal.ELSEWHERE)
        whole = [here, *positions]
    else:
        high = [[row[0], row[1], max(row[2], SITE.travel_height_m)] for row in (here, first, last)]
        whole = [here, high[0], high[1], *positions, high[2]]
    if Refusal.TOOL not in rules and any(reached_m(pose) > REACH.radius_m for pose in along(motion, tool)):
        rules.add(Refusal.REACH)
    for volume in SITE.limits.keep_out:
        if any(crosses(a, b, volume) for a, b in itertools.pairwise(whole)):
            rules.add(Refusal.KEEP_OUT)
    return rules


def answered(arm: ArmControl, motion: Motion) -> str:
    """Answer of the gate to the motion: the code of its refusal, or "passed"."""
    try:
        begin(arm, motion, motion.digest(), SITE)
    except MotionRefused as refusal:
        return refusal.code
    return "passed"


def test_of_ten_thousand_commands_none_that_breaks_a_limit_passes_and_none_that_keeps_them_is_refused() -> None:
    rng, met = np.random.default_rng(7), Counter[str]()
    for number in range(COMMANDS):
        tool = pointing_down(np.array([0.30, 0.0, 0.30]))
        motion = command(rng)
        if motion.continues and len(motion.positions) and rng.random() < 0.5:
            tool = pointing_down(np.clip(np.nan_to_num(motion.positions[0]), BOX.low, BOX.high))
        arm, rules = ArmControl(SITE, tool), broken(motion, tool)
        answer = answered(arm, motion)
        assert answer in (rules or {"passed"}), f"command {number} breaks {rules or 'nothing'}; the gate says {answer}"
        assert arm.mode == ("moving" if answer == "passed" else "idle")
        met[answer] += 1
    assert met.keys() == {
        "passed", "shape", "not-finite", "outside-workspace", "keep-out", "speed", "tool", "elsewhere", "out-of-reach",
    }  # fmt: skip
    assert met["passed"] > COMMANDS / 4
    assert min(met.values()) > 30


def test_a_command_that_passes_is_made_within_all_limits() -> None:
    rng, made = np.random.default_rng(8), 0
    while made < 25:
        motion = command(rng)
        arm = ArmControl(SITE, pointing_down(np.array([0.30, 0.0, 0.30])))
        if answered(arm, motion) != "passed":
            continue
        made += 1
        before = arm.commanded
        for _ in range(4000):
            arm.advance(TICK_S)
            assert BOX.contains(arm.commanded[:3])
            assert np.linalg.norm(arm.commanded[:3] - before[:3]) <= SITE.limits.speed_m_s * TICK_S * (1 + 1e-6)
            assert SITE.limits.entered_volume(np.stack([before, arm.commanded])[:, :3]) is None
            before = arm.commanded
            if arm.mode == "idle":
                break


GOOD = Motion(positions=np.array([[0.5, 0.0, 0.02], [0.55, 0.0, 0.02]]), speeds=np.full(2, 0.2))


def test_a_motion_through_a_volume_that_is_kept_free_is_refused_by_the_name_of_the_volume() -> None:
    around_it = Motion(positions=np.array([[0.65, 0.05, 0.05], [0.65, 0.25, 0.05]]), speeds=np.full(2, 0.2))
    arm = ArmControl(SITE, pointing_down(np.array([0.30, 0.0, 0.30])))
    with pytest.raises(MotionRefused, match="'camera stand', which is kept free") as refusal:
        begin(arm, around_it, around_it.digest(), SITE)
    assert refusal.value.code is Refusal.KEEP_OUT


def test_a_motion_whose_way_there_leads_through_such_a_volume_is_refused() -> None:
    beyond = Motion(positions=np.array([[0.65, 0.30, 0.05]]), speeds=np.array([0.2]))
    arm = ArmControl(SITE, pointing_down(np.array([0.65, 0.0, 0.12])))
    with pytest.raises(MotionRefused, match="way to the motion enters"):
        begin(arm, beyond, beyond.digest(), SITE)


def test_a_motion_further_than_the_arm_reaches_is_refused_by_how_far() -> None:
    far = Motion(positions=np.array([[0.60, 0.0, 0.05], [0.84, 0.0, 0.05]]), speeds=np.full(2, 0.2))
    arm = ArmControl(SITE, pointing_down(np.array([0.30, 0.0, 0.30])))
    with pytest.raises(MotionRefused, match="The motion goes 40 mm further than the arm reaches") as refusal:
        begin(arm, far, far.digest(), SITE)
    assert refusal.value.code is Refusal.REACH
    assert arm.mode == "idle"


def test_the_way_to_a_motion_may_be_out_of_reach_where_the_motion_is_not() -> None:
    high = dataclasses.replace(SITE, travel_height_m=0.44)
    # Lower down both ends are within reach, with the wrist 0.8 m from the shoulder or less.
    near = Motion(positions=np.array([[0.72, 0.0, 0.05]]), speeds=np.array([0.2]))
    arm = ArmControl(high, pointing_down(np.array([0.30, 0.0, 0.30])))
    with pytest.raises(MotionRefused, match="The way to the motion goes") as refusal:
        begin(arm, near, near.digest(), high)
    assert refusal.value.code is Refusal.REACH


@pytest.mark.parametrize("mode", ["stopped", "moving"])
def test_an_arm_that_is_not_idle_begins_nothing(mode: str) -> None:
    arm = ArmControl(SITE, pointing_down(np.array([0.30, 0.0, 0.30])))
    if mode == "moving":
        begin(arm, GOOD, GOOD.digest(), SITE)
    else:
        arm.stop("for the test")
    with pytest.raises(MotionRefused, match=mode) as refusal:
        begin(arm, GOOD, GOOD.digest(), SITE)
    assert refusal.value.code is (Refusal.BUSY if mode == "moving" else Refusal.STOPPED)


def test_other_numbers_than_the_approved_ones_are_refused() -> None:
    arm = ArmControl(SITE, pointing_down(np.array([0.30, 0.0, 0.30])))
    with pytest.raises(MotionRefused, match="digest"):
        begin(arm, GOOD, dataclasses.replace(GOOD, turns=np.tile(TOOL_DOWN, (2, 1))).digest(), SITE)


def test_a_line_that_touches_a_volume_does_not_enter_it() -> None:
    volume = KeepOut(name="cube", low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0))
    along_a_face = np.array([[-1.0, 0.5, 1.0], [2.0, 0.5, 1.0]])
    assert not volume.is_entered_by(along_a_face)
    assert volume.is_entered_by(along_a_face - [0.0, 0.0, 1e-9])
    assert volume.is_entered_by(np.array([[0.5, 0.5, 0.5]]))
    assert not volume.is_entered_by(np.array([[-0.1, 0.5, 0.5], [-1e-9, 0.5, 0.5]]))
