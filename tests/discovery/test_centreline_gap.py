"""Residuals of a rope from where its centreline is: found again from clouds of other points, along the rope, too."""

from dataclasses import replace

import numpy as np
import pytest

from app.discovery.residuals.centreline_gap import centreline_gap, gap_of_displaced
from app.discovery.residuals.displacement_field import Basis, register
from app.sim.rods.geometry.centreline import settle, trace
from app.sim.rods.geometry.rope_cloud import RopeShape
from app.tasks.elements.curves import fill_tube

ROPE = RopeShape(count=41, rest_m=0.01, radius_m=0.008)
POINTS = 300
PLACE = np.linspace(0, 1, ROPE.count)


def line(bend: float, shift_m: float = 0.0) -> np.ndarray:
    """Nodes of a bent rope of this length, moved by `shift_m` along itself."""
    heading = bend * np.sin(2 * np.pi * PLACE[:-1] + 0.4)
    nodes = np.cumsum(np.vstack([[0.3, 0.0], ROPE.rest_m * np.column_stack([np.cos(heading), np.sin(heading)])]), 0)
    edges = np.gradient(nodes, axis=0)
    return nodes + shift_m * edges / np.linalg.norm(edges, axis=1, keepdims=True)


def cloud(nodes: np.ndarray, seed: int, noise_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of the rope along these nodes, and their places along it, from 0 to 1."""
    middle = np.column_stack([nodes, np.full(len(nodes), ROPE.radius_m)])
    exact = fill_tube(middle, ROPE.radius_m, POINTS, seed=seed)
    near = ((exact[:, None, :2] - nodes[None]) ** 2).sum(2).argmin(1)
    edges = np.gradient(nodes, axis=0)
    beside = ((exact[:, :2] - nodes[near]) * edges[near]).sum(1) / (edges[near] ** 2).sum(1)
    along = np.clip((near + beside) / (ROPE.count - 1), 0, 1)
    noise = np.random.default_rng(seed).normal(0, noise_m, exact.shape)
    return (exact + noise).astype(np.float32), along.astype(np.float32)


@pytest.mark.parametrize("noise_m", [0.0, 0.001])
@pytest.mark.parametrize("shift_m", [0.0, 0.004])
def test_displacements_are_found_better_than_by_registering_clouds_whose_points_have_no_order(
    noise_m: float, shift_m: float
) -> None:
    before, after = line(0.5), line(0.7, shift_m)
    predicted, along = cloud(before, 1)
    observed, _ = cloud(after, 2, noise_m)
    true = np.column_stack([np.interp(along, PLACE, column) for column in (after - before).T])
    found = centreline_gap(predicted, observed, along, ROPE)
    error_m = np.sqrt(((found - true) ** 2).sum(1).mean())
    basis = Basis.along(predicted, 2 * along - 1)
    registered = basis.field(register(predicted, observed, basis))
    assert error_m < 0.0015
    assert error_m < 0.7 * np.sqrt(((registered - true) ** 2).sum(1).mean())


def test_the_end_that_the_prediction_calls_the_first_is_the_first() -> None:
    predicted, along = cloud(line(0.5), 1)
    observed, _ = cloud(line(0.7), 2)
    straight, turned = (centreline_gap(predicted, observed, each, ROPE) for each in (along, 1 - along))
    np.testing.assert_allclose(straight, turned, atol=1e-5)


def test_of_several_orders_that_one_is_observed_which_is_nearer_to_the_prediction() -> None:
    found = trace(cloud(line(0.5), 1)[0], ROPE)
    elsewhere = found.line + np.array([0.03, 0.02])
    two = replace(found, lines=np.stack([found.line, elsewhere]), scores=np.array([0.0, 1.0]))
    np.testing.assert_array_equal(two.near(elsewhere[::-1] + 0.001), elsewhere[::-1])
    np.testing.assert_array_equal(two.near(found.line), found.line)
    # What explains the cloud far worse is not made up for by being near.
    hopeless = replace(two, scores=np.array([0.0, 20.0]))
    np.testing.assert_array_equal(hopeless.near(elsewhere), found.line)


def test_a_centreline_is_settled_where_it_is_traced_from_a_line_beside_it_and_runs_the_same_way() -> None:
    points, _ = cloud(line(0.6), 3)
    traced = trace(points, ROPE).line
    beside = line(0.6) + np.array([0.002, -0.002])
    same = traced if np.linalg.norm(traced - beside) < np.linalg.norm(traced[::-1] - beside) else traced[::-1]
    np.testing.assert_allclose(settle(points, beside, ROPE), same, atol=3e-4)
    np.testing.assert_allclose(settle(points, beside[::-1], ROPE), same[::-1], atol=3e-4)


@pytest.mark.parametrize("turn", [0.01, 0.3])
def test_a_turn_of_the_cameras_is_found_as_it_is_and_a_stretch_of_a_straight_rope_not_at_all(turn: float) -> None:
    bent, along = cloud(line(0.6), 4)
    about = bent - bent.mean(0)
    cos, sin = np.cos(turn) - 1, np.sin(turn)
    turned = np.column_stack([cos * about[:, 0] - sin * about[:, 1], sin * about[:, 0] + cos * about[:, 1], 0 * along])
    found = gap_of_displaced(turned.astype(np.float64), bent, along, ROPE)
    beside = 0.008 * turn  # Particles turn about the centreline, too.
    np.testing.assert_allclose(found, turned[:, :2], atol=beside + 3e-4)
    straight, along = cloud(line(0.0), 4)
    stretched = 0.01 * (straight - straight.mean(0)) * [1.0, 1.0, 0.0]
    found = gap_of_displaced(stretched, straight, along, ROPE)
    assert np.linalg.norm(found, axis=1).mean() < 0.1 * np.linalg.norm(stretched, axis=1).mean()


@pytest.mark.parametrize(("first", "last"), [(0.4, 0.5), (0.3, 0.5), (0.2, 0.35)])
def test_particles_are_where_they_lie_on_the_line_beside_a_hole_too_which_their_ranks_do_not_know(
    first: float, last: float
) -> None:
    before, after = line(0.5), line(0.7)
    whole, along = cloud(before, 1)
    kept = (along < first) | (along > last)
    ranks = (np.argsort(np.argsort(along[kept])) / (kept.sum() - 1)).astype(np.float32)
    true, by_rank = (
        np.column_stack([np.interp(at, PLACE, c) for c in (after - before).T]) for at in (along[kept], ranks)
    )
    found = centreline_gap(whole[kept], cloud(after, 2)[0], ranks, ROPE)
    error_m, by_rank_m = (np.sqrt(((each - true) ** 2).sum(1).mean()) for each in (found, by_rank))
    assert error_m < 0.0015
    assert error_m < 0.7 * by_rank_m
