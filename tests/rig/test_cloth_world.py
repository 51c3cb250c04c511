"""The laws of the simulated cloth: what lies, hangs and slides, and that it neither stretches nor tears."""

import numpy as np
import pytest

from app.core.geometry.shapes.fixtures import Obstacle
from app.rig.simulated.worlds.cloth_world import ClothWorld
from tests.rig.cloth_scene import CLOTH, GRIPPER, KNOTS, MESH_M, RACK, flat, go, grasped, hand

LYING = flat(0.50, -0.18)
ROD_TOP_M = RACK.place_m[2] + RACK.radius_m


def world(nodes: np.ndarray = LYING) -> ClothWorld:
    return ClothWorld(CLOTH, GRIPPER, nodes, fixtures=(RACK,))


def wait(cell: ClothWorld, duration_s: float) -> np.ndarray:
    cell.step(cell.tool, duration_s)
    return cell.nodes()


def edges(nodes: np.ndarray) -> np.ndarray:
    """Lengths of the mesh's sides, over those of the cloth as it was cut."""
    knots = nodes.reshape(KNOTS, KNOTS, 3)
    sides = [np.linalg.norm(np.diff(knots, axis=axis), axis=-1).ravel() for axis in (0, 1)]
    return np.concatenate(sides) / MESH_M


def laid_over(y_m: float) -> ClothWorld:
    """A flat cloth, its middle at y, that falls on the rods from just above them."""
    return world(flat(RACK.place_m[0], y_m, ROD_TOP_M + 0.005))


def test_a_cloth_that_lies_on_the_table_stays_there() -> None:
    cell = world()
    laid = wait(cell, 0.3)
    assert np.abs(wait(cell, 2.0) - laid).max() < 1e-5
    assert laid[:, 2] == pytest.approx(np.full(KNOTS**2, 0.002), abs=3e-4)


def test_a_cloth_that_is_grasped_at_its_edge_hangs_from_the_fingers() -> None:
    cell = world()
    hung = grasped(cell, 0.50, -0.067)
    assert 2 <= cell.held_nodes.sum() <= 16
    assert np.linalg.norm(hung[cell.held_nodes] - cell.tool[:3], axis=1).max() < 0.05
    assert hung[:, 2].max() < 0.37
    # Its far corners are as far down as the cloth allows, and nothing is on the table.
    assert 0.05 < hung[:, 2].min() < 0.35 - 0.9 * CLOTH.size_m + 0.01


def test_closing_fingers_hardly_move_the_cloth() -> None:
    cell = world()
    cell.place(hand(0.50, -0.067, 0.10, 0.04))
    lying = go(cell, hand(0.50, -0.067, 0.006, 0.04))
    taken = go(cell, hand(0.50, -0.067, 0.006, 0.004), rest_s=0.5)
    assert cell.held_nodes.any()
    # The knots that are held are pressed together from where the open fingers were.
    assert np.abs(taken - lying).max() < GRIPPER.opening_m
    assert np.linalg.norm(taken.mean(axis=0) - lying.mean(axis=0)) < 0.005


def test_open_fingers_hold_nothing_and_fingers_that_open_let_go() -> None:
    cell = world()
    cell.place(hand(0.50, -0.067, 0.10, 0.04))
    lifted = go(cell, hand(0.50, -0.067, 0.004, 0.04), hand(0.50, -0.067, 0.20, 0.04))
    assert not cell.held_nodes.any()
    assert lifted[:, 2].max() < 0.01
    grasped(cell, 0.50, -0.067)
    dropped = go(cell, hand(0.50, -0.067, 0.35, 0.04), rest_s=1.5)
    assert not cell.held_nodes.any()
    # In a heap, which may stand as high as a fold does.
    assert dropped[:, 2].max() < 0.08
    assert np.median(dropped[:, 2]) < 0.02


def test_fingers_that_close_beside_the_cloth_hold_nothing() -> None:
    cell = world()
    assert grasped(cell, 0.50, 0.02)[:, 2].max() < 0.01
    assert not cell.held_nodes.any()


def test_a_cloth_over_the_rods_stays() -> None:
    cell = laid_over(RACK.place_m[1])
    hung = wait(cell, 3.0)
    later = wait(cell, 2.0)
    assert hung[:, 2].min() > 0.05
    assert abs(later[:, 1].mean() - hung[:, 1].mean()) < 0.003


def test_a_cloth_that_hangs_too_far_to_one_side_slides_off() -> None:
    # With 10 cm more beyond one rod than beyond the other, friction over half a turn does not hold it.
    fallen = wait(laid_over(RACK.place_m[1] - 0.13), 4.0)
    assert np.median(fallen[:, 2]) < 0.05


def test_a_cloth_keeps_its_size_whatever_is_done_to_it() -> None:
    cell = world()
    lying = edges(cell.nodes())
    assert lying == pytest.approx(np.ones_like(lying), abs=1e-6)
    hung = edges(grasped(cell, 0.50, -0.067))
    assert hung.mean() == pytest.approx(1.0, abs=0.01)
    assert np.quantile(hung, 0.98) < 1.05
    draped = edges(wait(laid_over(RACK.place_m[1]), 2.0))
    assert draped.mean() == pytest.approx(1.0, abs=0.01)
    assert draped.max() < 1.05


def test_the_same_calls_give_the_same_numbers() -> None:
    first, second = world(), world()
    for cell in (first, second):
        grasped(cell, 0.50, -0.067)
    assert np.array_equal(first.nodes(), second.nodes())
    assert first.time_s == second.time_s


def test_a_world_begins_as_it_is_told_and_its_clock_where_it_is_told() -> None:
    cell = ClothWorld(CLOTH, GRIPPER, LYING, tool=hand(0.4, 0.1, 0.2, 0.03), time_s=7.0)
    assert cell.nodes() == pytest.approx(LYING, abs=1e-12)
    assert cell.tool == pytest.approx(hand(0.4, 0.1, 0.2, 0.03))
    wait(cell, 0.1)
    assert cell.time_s == pytest.approx(7.1)
    assert cell.snapshot().nodes == pytest.approx(cell.nodes())


def test_what_it_has_no_shape_for_is_refused() -> None:
    with pytest.raises(TypeError, match="Obstacle"):
        ClothWorld(CLOTH, GRIPPER, LYING, fixtures=(Obstacle(half_m=(0.1, 0.1, 0.1), place_m=(0.0, 0.0, 0.0)),))
