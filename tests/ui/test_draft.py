"""A goal while it is drawn: what each kind means for the object, and which points a curve takes."""

import math

import numpy as np
import pytest

from app.ui.goals.draft import LEAST_RADIUS_M, GoalDraft, on_table
from tests.ui import synthetic

OBJECT = synthetic.rope(0.5)


def test_nothing_is_meant_before_something_is_drawn() -> None:
    assert GoalDraft().positions(OBJECT) is None
    assert GoalDraft(kind="curve").positions(OBJECT) is None
    assert GoalDraft(kind="curve", curve=((0.4, 0.0),)).positions(OBJECT) is None


@pytest.mark.parametrize(
    "draft",
    [
        GoalDraft(kind="copy", place=(0.5, 0.1), turn_rad=0.4, bend_1_m=3.0),
        GoalDraft(kind="curve", curve=((0.4, 0.0), (0.6, 0.1))),
        GoalDraft(kind="region", place=(0.5, 0.0), radius_m=LEAST_RADIUS_M),
    ],
)
def test_what_is_drawn_means_as_many_particles_at_the_heights_that_they_have(draft: GoalDraft) -> None:
    goal = draft.positions(OBJECT)
    assert goal is not None
    assert goal.shape == OBJECT.shape
    np.testing.assert_array_equal(goal[:, 2], OBJECT[:, 2])


@pytest.mark.parametrize("place", [(0.4, 0.001), (math.inf, 0.0), (0.0, -1e9), (math.nan, 0.0), (0.5, math.nan)])
def test_a_point_that_is_the_last_one_again_or_far_away_is_none(place: tuple[float, float]) -> None:
    draft = GoalDraft(kind="curve", curve=((0.4, 0.0),))
    assert draft.with_point(*place) is draft


def test_a_curve_has_an_end() -> None:
    draft = GoalDraft(kind="curve")
    for index in range(1000):
        draft = draft.with_point(0.01 * (index % 7), 0.01 * (index % 11))
    assert len(draft.curve) == 200


def test_a_click_is_where_the_ray_meets_the_table() -> None:
    assert on_table((0.2, 0.1, 1.0), (0.3, 0.0, -1.0)) == pytest.approx((0.5, 0.1))
    assert on_table((0.2, 0.1, 1.0), (0.3, 0.0, 0.1)) is None
    assert on_table((0.2, 0.1, -1.0), (0.3, 0.0, -0.1)) is None
