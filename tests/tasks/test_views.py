"""Views of policies hold all of the table that actions reach, however that is turned."""

import itertools
from math import pi

import numpy as np
import pytest

from app.tasks import load, names


@pytest.mark.parametrize("name", names())
def test_all_that_actions_reach_is_seen_from_above_also_where_it_is_turned_about_one_place(name: str) -> None:
    task = load(name)
    symmetry, (low, high) = task.symmetry, task.actions.reach
    corners = np.array(list(itertools.product((low[0], high[0]), (low[1], high[1]))))
    fixed = symmetry.turns and not any(symmetry.shift_m)
    for angle in (0.0, pi / 2, pi, -pi / 2) if fixed else (0.0,):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        there = (corners - symmetry.about_m) @ turn.T + symmetry.about_m
        assert (there >= task.views[0].low[:2]).all()
        assert (there <= task.views[0].high[:2]).all()
