"""Random sweeps: in all directions, at all speeds, the paddle across its way, and down clear of all pieces."""

import numpy as np
import pytest

from app.policy.random_pushes import REGION, Stroke
from app.policy.random_sweeps import LENGTHS_M, clearance_m, random_sweep, sweep_design, yaw_across
from app.tasks.bean_sweep import BEANS, PADDLE, TASK

PLAN = sweep_design(8, 8)
HALF_M = PADDLE.half_m[:2]


def points(seed: int) -> np.ndarray:
    ends = TASK.start(seed).reshape(-1, 2, 3)
    return np.concatenate([ends, ends.mean(1, keepdims=True)], axis=1).reshape(-1, 3).astype(np.float32)


def sweeps(count: int) -> list[tuple[Stroke, np.ndarray]]:
    return [
        (
            random_sweep(np.random.default_rng(seed), points(seed), PLAN, radius_m=BEANS.radius_m, half_m=HALF_M),
            points(seed),
        )
        for seed in range(count)
    ]


def test_the_paddle_comes_down_clear_of_all_beans_and_reaches_one() -> None:
    for stroke, beans in sweeps(60):
        assert clearance_m(stroke, beans, HALF_M) > BEANS.radius_m + 0.005
        inside = (beans[:, :2] - stroke.start) @ np.stack([stroke.ahead, [-stroke.ahead[1], stroke.ahead[0]]], axis=1)
        ahead = (inside[:, 0] > 0) & (inside[:, 0] < stroke.length_m + HALF_M[1] + BEANS.radius_m)
        assert np.any(ahead & (np.abs(inside[:, 1]) < HALF_M[0]))


def test_sweeps_go_all_ways_at_speeds_and_lengths_of_the_plan_inside_the_workspace() -> None:
    drawn = [stroke for stroke, _ in sweeps(120)]
    angles = [np.arctan2(stroke.ahead[1], stroke.ahead[0]) for stroke in drawn]
    assert np.all(np.histogram(angles, 8, (-np.pi, np.pi))[0] >= 3)
    speeds, lengths = (np.array([getattr(stroke, name) for stroke in drawn]) for name in ("speed_m_s", "length_m"))
    for values, (low, high) in ((speeds, (0.05, 0.30)), (lengths, LENGTHS_M)):
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    ends = np.array([[stroke.start, stroke.end] for stroke in drawn])
    assert np.all((ends > REGION[:2]) & (ends < REGION[2:]))


@pytest.mark.parametrize("angle", np.linspace(-np.pi, np.pi, 13))
def test_the_paddle_is_turned_by_the_lesser_angle_as_in_planned_sweeps(angle: float) -> None:
    from app.config import Site

    ahead = np.array([np.cos(angle), np.sin(angle)])
    yaw = yaw_across(ahead)
    assert abs(yaw) <= np.pi / 2 + 1e-9
    assert abs(np.array([np.cos(yaw), np.sin(yaw)]) @ ahead) < 1e-9
    action = np.array([0.5, 0.0, *(np.array([0.5, 0.0]) + 0.1 * ahead)], np.float32)
    motion = TASK.actions.motion(action, np.zeros(8), Site())
    track = Stroke(start=np.array([0.5, 0.0]), ahead=ahead, length_m=0.1, speed_m_s=0.1, yaw_rad=yaw)
    turned = track.track(start_s=0.0, height_m=PADDLE.sweep_height_m).poses[0, 3:]
    same = np.array([turned[1], turned[2]]) @ np.array([motion.turns[0, 1], motion.turns[0, 2]])
    # At a quarter of a turn either face may be ahead.
    assert abs(same) == pytest.approx(1.0, abs=1e-6) or abs(abs(yaw) - np.pi / 2) < 1e-6
    assert abs(same) == pytest.approx(1.0, abs=1e-6) or abs(same) < 1e-6
