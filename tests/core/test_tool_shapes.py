"""Tools own their geometry: laws of outlines and hulls that hold for every kind of tool."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from app.core.geometry.shapes.outlines import Outline
from app.core.geometry.shapes.tools import Gripper, Tool
from app.core.motion import TOOL_DOWN
from app.tasks.bean_sweep import PADDLE
from app.tasks.cloth_hang import GRIPPER
from app.tasks.pour_water import HELD
from app.tasks.rope_push import FINGER

TOOLS: dict[str, Tool] = {
    "finger": FINGER,
    "flat finger": replace(FINGER, radius_m=0.006, half_width_m=0.02, yaw_rad=0.9),
    "paddle": PADDLE,
    "gripper": GRIPPER,
    "bowl": HELD,
}
AHEAD = [np.array([np.cos(turn), np.sin(turn)]) for turn in np.linspace(0.0, 2 * np.pi, 7)[:-1]]


def pose(turn_rad: float = 0.0, opening_m: float = 0.02) -> np.ndarray:
    turn = Rotation.from_euler("z", turn_rad) * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    return np.array([0.5, 0.1, 0.03, *turn.as_quat(scalar_first=True), opening_m])


def outline_of(name: str, turn_rad: float = 0.0) -> Outline:
    outline = TOOLS[name].outline(pose(turn_rad))
    assert outline is not None
    return outline


PUSHING = [name for name, tool in TOOLS.items() if tool.outline(pose()) is not None]
pushing = pytest.mark.parametrize("name", PUSHING)


def offsets(outline: Outline) -> np.ndarray:
    """Offsets from the tool's middle, inside the outline and around it."""
    return np.random.default_rng(2).uniform(-1.2, 1.2, (2000, 2)) * outline.extent_m


def test_every_kind_of_tool_is_tested() -> None:
    assert {type(tool) for tool in TOOLS.values()} == set(get_args(Tool))


@pushing
@pytest.mark.parametrize("turn_rad", [0.0, 0.7])
def test_a_point_inside_leaves_the_outline_where_it_ends_and_not_before(name: str, turn_rad: float) -> None:
    outline = outline_of(name, turn_rad)
    x = offsets(outline)
    for ahead in AHEAD:
        out = outline.exit_m(x, ahead)
        inside = out > 0
        assert 100 < inside.sum() < len(x)
        before, after = (x[inside] + share * out[inside, None] * ahead for share in (0.99, 1.001))
        np.testing.assert_allclose(outline.exit_m(before, ahead), 0.01 * out[inside], atol=1e-9)
        assert not outline.exit_m(after, ahead).any()


@pushing
@pytest.mark.parametrize("turn_rad", [0.0, 0.7])
def test_nothing_of_the_outline_is_farther_than_its_extent_and_its_back(name: str, turn_rad: float) -> None:
    outline = outline_of(name, turn_rad)
    x = offsets(outline)
    for ahead in AHEAD:
        inside = x[outline.exit_m(x, ahead) > 0]
        assert np.linalg.norm(inside, axis=1).max() == pytest.approx(outline.extent_m, rel=0.2)
        assert np.linalg.norm(inside, axis=1).max() <= outline.extent_m
        assert (inside @ ahead).min() == pytest.approx(-outline.half_extent_m(ahead), rel=0.2)
        assert (inside @ ahead).min() >= -outline.half_extent_m(ahead)


@pushing
def test_the_hulls_contain_all_of_the_outline_above_the_lowest_part(name: str) -> None:
    tool, at = TOOLS[name], pose(0.4)
    outline = outline_of(name, 0.4)
    x = offsets(outline)
    x = x[outline.exit_m(x, AHEAD[0]) > 0]
    height = at[2] + 0.007  # Above the round lower edge of a finger.
    points = np.column_stack([x + at[:2], np.full(len(x), height)])
    contained = np.zeros(len(points), bool)
    for corners in tool.hulls(at, 0.0):
        hull = ConvexHull(corners)
        contained |= (points @ hull.equations[:, :3].T + hull.equations[:, 3] < 1e-9).all(axis=1)
    # A finger's round edge is narrower there than its radius.
    assert contained.mean() > 0.9


def bounds(tool: Tool, at: np.ndarray, margin_m: float = 0.0) -> np.ndarray:
    """Lowest and highest corner of all hulls."""
    corners = np.concatenate(tool.hulls(at, margin_m))
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


@pytest.mark.parametrize("name", [name for name in TOOLS if TOOLS[name].hulls(pose(), 0.0)])
def test_the_hulls_move_with_the_tool(name: str) -> None:
    tool, at, by = TOOLS[name], pose(), np.array([0.1, -0.05, 0.2])
    there = at.copy()
    there[:3] += by
    np.testing.assert_allclose(bounds(tool, there), bounds(tool, at) + by, atol=1e-12)


@pushing
def test_the_hulls_of_a_tool_that_pushes_are_larger_by_the_margin_on_every_side(name: str) -> None:
    margin_m = 0.01
    low, high = bounds(TOOLS[name], pose(0.3), margin_m) - bounds(TOOLS[name], pose(0.3))
    assert (low <= -margin_m + 1e-12).all()
    assert (high >= margin_m - 1e-12).all()
    assert max(-low.min(), high.max()) < 1.5 * margin_m


@pytest.mark.parametrize("name", sorted(set(TOOLS) - set(PUSHING)))
def test_what_holds_the_object_has_no_margin_over_it(name: str) -> None:
    tool = TOOLS[name]
    for one, other in zip(tool.hulls(pose(), 0.0), tool.hulls(pose(), 0.02), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_jaws_are_as_far_apart_as_they_are_open() -> None:
    left, right = Gripper(half_m=(0.03, 0.006, 0.025), opening_m=0.04, closed_m=0.01).hulls(pose(0.0, 0.03), 0.0)
    inner = sorted([left[:, 1].min(), left[:, 1].max(), right[:, 1].min(), right[:, 1].max()])
    assert inner[2] - inner[1] == pytest.approx(0.03)
    assert inner[3] - inner[2] == pytest.approx(0.012)
