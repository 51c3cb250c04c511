"""A push whose ends an operator has moved is simulated and costed as the branches that it is compared with."""

import numpy as np
import pytest

from app.core.errors import PlanningError
from app.core.messages import Branch
from app.core.path_similarity_transform import reshape
from app.jobs import worker_api
from app.jobs.edited import edited_plan
from app.jobs.worker_api import nominal_model
from app.tasks import load

TASK, PRESET = load("rope_push"), "cpu"
COUNT = TASK.preset(PRESET).particle_count
MODEL = nominal_model("rope_push")
OBSERVED, GOAL = TASK.particles(TASK.start(1), COUNT), TASK.goal(1, COUNT)


def straight(start: tuple[float, float], end: tuple[float, float]) -> Branch:
    ends = np.array([[*start, 0.006], [*end, 0.006]])
    path = ends[0] + np.linspace(0, 1, 30)[:, None] * (ends[1] - ends[0])
    return Branch(
        origin="random",
        actions=np.zeros((2, 42), np.float32),
        tool_path=path.astype(np.float32),
        predicted=OBSERVED,
        final=OBSERVED,
        cost_before=1.0,
        cost_after=1.0,
        terms={},
        finite=True,
    )


def across() -> tuple[np.ndarray, np.ndarray]:
    """A push of 8 cm that begins beside the middle of the object and goes through it."""
    middle = OBSERVED[len(OBSERVED) // 2, :2].astype(float)
    for angle in np.linspace(0, 2 * np.pi, 64):
        ahead = np.array([np.cos(angle), np.sin(angle)])
        start = middle - 0.04 * ahead
        if np.linalg.norm(OBSERVED[:, :2] - start, axis=1).min() > 0.028:
            return np.array([*start, 0.0]), np.array([*(start + 0.08 * ahead), 0.0])
    raise AssertionError("The object lies on all of its surroundings.")


BRANCHES = (straight((0.4, -0.2), (0.5, -0.2)), straight((0.5, 0.2), (0.6, 0.2)))


def test_the_edited_branch_comes_first_and_the_others_behind_it() -> None:
    start, end = across()
    found = edited_plan("rope_push", PRESET, OBSERVED, GOAL, MODEL, BRANCHES, 1, start, end)
    edited = found.branches[0]
    assert found.best == 0
    assert edited.origin == "edited"
    assert found.branches[1:] == BRANCHES
    np.testing.assert_allclose(edited.tool_path[[0, -1], :2], [start[:2], end[:2]], atol=1e-5)
    np.testing.assert_allclose(found.motion.positions[[1, -2], :2], [start[:2], end[:2]], atol=1e-5)
    assert np.linalg.norm(edited.predicted - OBSERVED, axis=1).max() > 0.01
    assert edited.terms["progress"] + edited.terms["contact"] == pytest.approx(edited.cost_after, abs=1e-7)
    assert len(edited.actions) == TASK.preset(PRESET).depth
    np.testing.assert_allclose(edited.frames[-1], edited.final, atol=1e-6)


def test_an_unmoved_motion_of_a_plan_costs_and_predicts_what_it_did() -> None:
    plan = worker_api.plan("rope_push", PRESET, OBSERVED, GOAL, MODEL, 0)
    best = plan.branches[plan.best]
    ends = best.tool_path[[0, -1]].astype(float)
    found = edited_plan("rope_push", PRESET, OBSERVED, GOAL, MODEL, plan.branches, plan.best, *ends)
    moved_m = np.linalg.norm(best.predicted - OBSERVED, axis=1).max()
    assert np.linalg.norm(found.predicted - best.predicted, axis=1).max() < 0.2 * moved_m
    way = reshape(best.tool_path.astype(float), *ends)
    apart = np.linalg.norm(found.branches[0].tool_path[:, None] - way[None], axis=2).min(1)
    assert apart.max() < 0.002


@pytest.mark.parametrize(
    ("start", "end", "says"),
    [
        ((0.30, -0.30), (0.30, -0.298), "pull its ends apart"),
        ((0.30, -0.30), (0.60, -0.30), "the longest push of this task is 18 cm"),
        ((0.30, -0.30), (0.30, -0.40), "leaves the region"),
        ((np.nan, -0.30), (0.30, -0.20), "on the table"),
        (tuple(OBSERVED[7, :2]), tuple(OBSERVED[7, :2] + np.float32(0.04)), "move its start away"),
    ],
)
def test_what_is_wrong_with_a_push_is_said(start: tuple[float, float], end: tuple[float, float], says: str) -> None:
    ends = np.array([*start, 0.0]), np.array([*end, 0.0])
    with pytest.raises(PlanningError, match=says):
        edited_plan("rope_push", PRESET, OBSERVED, GOAL, MODEL, BRANCHES, 0, *ends)


def test_a_branch_that_is_not_there_and_a_task_without_pushes_are_refused_in_words() -> None:
    start, end = across()
    with pytest.raises(PlanningError, match="no such branch"):
        edited_plan("rope_push", PRESET, OBSERVED, GOAL, MODEL, BRANCHES, 7, start, end)
    cloth = nominal_model("cloth_hang")
    with pytest.raises(PlanningError, match="cannot be edited"):
        edited_plan("cloth_hang", PRESET, OBSERVED, GOAL, cloth, BRANCHES, 0, start, end)
