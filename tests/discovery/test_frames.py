"""The frame test finds the frame in which residuals were made constant, and none where they are noise."""

from functools import cache

import numpy as np
import pytest

from app.discovery.checks.frames import frame_tests
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.case import FrameTest
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign, random_track
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push")
SUBJECT = subject_of(TASK)
PUSHES, EPISODES = 48, 6
SIZE_M = 4e-3


@cache
def trials() -> SimulationBatch:
    rng, pushes, now_s = np.random.default_rng(0), list[Push](), 0.0
    for number in range(PUSHES):
        x = fill_tube(TASK.start(number), TASK.rope.radius_m, 300)
        track = random_track(rng, x, PushDesign(), start_s=now_s + 0.5, height_m=TASK.finger.push_height_m)
        now_s = track.end_s + 0.5
        pushes.append(
            Push(
                episode=number * EPISODES // PUSHES,
                before=ProjectionView(time_s=float(track.times_s[0]), points=x),
                during=(),
                after=ProjectionView(time_s=now_s, points=x),
                command=track,
                measured=None,
            )
        )
    return prepare(Study(task="rope_push", pushes=tuple(pushes)), SUBJECT)


def judged(residuals: np.ndarray) -> dict[str, FrameTest]:
    """Frame tests of residuals (K, N, 2) with noise of a millimetre per push and two per point."""
    rng = np.random.default_rng(1)
    noisy = residuals + rng.normal(0, 1e-3, (PUSHES, 1, 2)) + rng.normal(0, 2e-3, residuals.shape)
    places = np.stack([push.before.points[:, :2] for push in trials().study.pushes]).astype(np.float64)
    return {test.frame: test for test in frame_tests(trials(), places, noisy)}


def every(vectors: np.ndarray) -> np.ndarray:
    """One vector (K, 2) per push, repeated for all of its points."""
    return np.repeat(vectors[:, None], 300, axis=1)


def headings() -> np.ndarray:
    tracks = [push.command.positions for push in trials().study.pushes]
    ways = np.stack([way[-1, :2] - way[0, :2] for way in tracks])
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def yaws() -> np.ndarray:
    """Direction of the tool's own x axis on the table."""
    q = np.stack([push.command.poses[0, 3:] for push in trials().study.pushes])
    return np.stack([1 - 2 * (q[:, 2] ** 2 + q[:, 3] ** 2), 2 * (q[:, 0] * q[:, 3] + q[:, 1] * q[:, 2])], axis=1)


def towards_camera() -> np.ndarray:
    middle = np.stack([push.before.points[:, :2].mean(0) for push in trials().study.pushes])
    ways = middle - np.asarray(trials().study.camera)[:2]
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


MADE = {
    "world": lambda: every(np.tile([0.6, -0.8], (PUSHES, 1))),
    "push": lambda: every(headings()),
    "tool": lambda: every(yaws()),
    "camera": lambda: every(towards_camera()),
}


@pytest.mark.parametrize("frame", MADE)
def test_a_residual_that_is_constant_in_a_frame_is_found_there(frame: str) -> None:
    found = judged(SIZE_M * MADE[frame]())
    assert max(found.values(), key=lambda test: test.explained).frame == frame
    assert found[frame].explained > 0.7
    assert found[frame].low <= found[frame].explained <= found[frame].high


def test_a_residual_at_a_place_along_the_object_is_found_in_the_material() -> None:
    labels = trials().labels
    normals = np.stack([-labels[:, :, 3], labels[:, :, 2]], axis=2)
    bent = SIZE_M * np.sin(np.pi * labels[:, :, :1]) * normals
    found = judged(bent)
    assert max(found.values(), key=lambda test: test.explained).frame == "material"


def test_a_residual_that_grows_with_the_session_is_found_in_time() -> None:
    grown = SIZE_M * 3 * trials().times[:, None] * headings()
    found = judged(every(grown))
    assert max(found.values(), key=lambda test: test.explained).frame == "time"


def test_of_noise_no_frame_explains_much() -> None:
    assert max(test.explained for test in judged(np.zeros((PUSHES, 300, 2))).values()) < 0.15
