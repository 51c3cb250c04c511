"""Orientation of a rope: its first end is found from simulated pushes, and kept as the rope turns.

The world is our own rod with effects along it, seen as a cloud without order; its true ends are hidden from the
code under test.
"""

from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, final

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.messages import Executed, MessageId, Model, Transition, fresh_id
from app.core.motion import TOOL_DOWN
from app.core.types import Centreline, Points
from app.evaluation.episode import EvaluationConfig, play
from app.jobs import jit_cache, worker_api
from app.jobs.rope_orientation import oriented_phi
from app.jobs.worker_api import nominal_model, plan, track_orientation, update
from app.planner.method import DIPAC
from app.planner.search.plan import Plan
from app.sim.model.params import index, with_orientation
from app.sim.rods.geometry.polyline import distance
from app.sim.rods.state import RodState
from app.tasks import load
from tests.models import model_with

RODS = "rope_push@rods"
TASK = load(RODS)
COUNT = 300
NOISE_M = 8e-4
PUSH_M, BESIDE_M = 0.12, 0.03
MIRRORED = jnp.array([1, 1, 1, 1, 1, 1, 1, -1], jnp.float32)[:, None]
"""Signs of a state's rows when its nodes are counted from the other end: bends are to the left of their order."""


knowing = partial(model_with, RODS)
"""The model of rods with other values of these parameters."""
CURVED = knowing(rest_curvature=8.0, stiffness_slope=0.6)
SURE = 4
"""Number of pushes after which the ends of that rope are known."""


@final
@dataclass(kw_only=True)
class World:
    """A rope whose first node is its first end, pushed at its last end, always to the same side, so that it turns."""

    state: RodState
    rng: np.random.Generator

    @property
    def nodes(self) -> np.ndarray:
        return np.asarray(self.state.centreline[0])

    def seen(self) -> Points:
        x = np.asarray(self.state.x[0]) + self.rng.normal(0, NOISE_M, (COUNT, 3))
        return self.rng.permutation(x).astype(np.float32)

    def pushed(self, model: Model) -> Transition:
        before, way = self.seen(), self.way()
        phi, path = jit_cache.phi_of(model), TASK.actions.measured_path(way)
        simulate = jit_cache.action_simulator(RODS, COUNT, *jit_cache.needs(RODS, phi))
        end = simulate(jnp.asarray(phi)[None], self.state, jnp.asarray(path)[None])
        assert isinstance(end, RodState)
        self.state = end
        return transition(before, way, self.seen())

    def way(self) -> np.ndarray:
        along = self.nodes[:, -3] - self.nodes[:, -8]
        left = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        start = self.nodes[:, -5] - BESIDE_M * left
        shares = np.linspace(0, 1, 30)[:, None]
        return np.concatenate([start + shares * PUSH_M * left, np.full((30, 1), TASK.finger.push_height_m)], axis=1)


def transition(before: Points, way: np.ndarray, after: Points) -> Transition:
    poses = np.concatenate([way, np.tile(TOOL_DOWN, (len(way), 1))], axis=1)
    executed = Executed(
        id=fresh_id("executed"),
        time_s=1.0,
        approved_id=MessageId("test"),
        outcome="completed",
        reason="",
        times_s=np.linspace(0.0, 1.0, len(way)),
        commanded=poses,
        measured=poses,
    )
    return Transition(id=fresh_id("transition"), time_s=1.0, before=before, executed=executed, after=after)


def world(seed: int, first: float = 1.0) -> World:
    """A rope at rest whose first end is the one with the smaller x, or the other one if `first` is -1."""
    x = jnp.asarray(TASK.particles(TASK.start(seed), COUNT))[None]
    begun = TASK.initial_state(x)
    if first < 0:
        begun = TASK.initial_state(x, begun.centreline[0, :, ::-1])
    assert isinstance(begun, RodState)
    return World(state=begun, rng=np.random.default_rng(seed))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """The rope after a push: what is known of its ends, its true nodes from its first end on, and a view of it."""

    known: Orientation
    nodes: Centreline
    x: Points


@cache
def sequence(first: float) -> tuple[Seen, ...]:
    """Twelve pushes of a rope, by which it turns over."""
    here, known, seen = world(0, first), UNKNOWN, list[Seen]()
    for _ in range(12):
        known = track_orientation(RODS, known, here.pushed(CURVED), CURVED)
        seen.append(Seen(known=known, nodes=here.nodes, x=here.seen()))
    return tuple(seen)


def canonical(x: Points) -> Centreline:
    """Nodes of a rope from a view, with nothing known of its ends."""
    return np.asarray(TASK.initial_state(jnp.asarray(x)[None]).centreline[0])


def runs_along(line: Centreline, nodes: Centreline) -> bool:
    return bool(np.linalg.norm(line - nodes) < np.linalg.norm(line[:, ::-1] - nodes))


@pytest.mark.parametrize("first", [1.0, -1.0])
def test_the_first_end_is_found_and_kept_as_the_rope_turns(first: float) -> None:
    seen = sequence(first)
    for each in seen[SURE - 1 :]:
        assert each.known.sign(each.nodes) == 1.0
        assert each.known.sign(each.nodes[:, ::-1]) == -1.0
    ways = {runs_along(canonical(each.x), each.nodes) for each in seen[SURE - 1 :]}
    assert ways == {True, False}, "the rope has turned over, or the test tells nothing"


@pytest.mark.parametrize("first", [1.0, -1.0])
def test_parameters_that_are_odd_along_the_rope_have_the_sign_of_its_nodes_order(first: float) -> None:
    signs = list[float]()
    for each in sequence(first)[SURE - 1 :]:
        line, phi = canonical(each.x), oriented_phi(CURVED, each.x, each.known)
        signs.append(float(np.sign(phi[index("rest_curvature")])))
        told = 1.0 if runs_along(line, each.nodes) else -1.0
        # A rope that lies folded is not traced without a prediction, and then no sign would be right.
        traced = distance(line.T.astype(np.float64), each.nodes.T.astype(np.float64)) < TASK.rope.radius_m
        assert signs[-1] == told or not traced
        assert phi[index("rest_curvature")] == pytest.approx(signs[-1] * 8.0)
        assert phi[index("stiffness_slope")] == pytest.approx(signs[-1] * 0.6)
        for near in (each.nodes, np.ascontiguousarray(each.nodes[:, ::-1])):
            known = oriented_phi(CURVED, each.x, each.known, near)
            assert known[index("rest_curvature")] == pytest.approx(8.0 if near is each.nodes else -8.0)
    assert signs.count(0.0) < len(signs) / 4


def test_while_nobody_knows_the_ends_what_is_even_along_the_rope_acts_alone() -> None:
    model = knowing(stiffness_slope=0.5, stiffness_bow=0.4, rest_curvature=4.0, friction_drift=0.2)
    even = jit_cache.phi_of(knowing(stiffness_bow=0.4, friction_drift=0.2))
    np.testing.assert_array_equal(oriented_phi(model, world(1).seen(), UNKNOWN), even)


def test_what_is_known_of_a_rope_that_lies_elsewhere_or_of_another_model_is_nothing() -> None:
    last = sequence(1.0)[-1]
    aside = last.x + np.array([0.0, 0.6, 0.0], np.float32)
    assert oriented_phi(CURVED, aside, last.known)[index("rest_curvature")] == 0.0
    other = knowing(rest_curvature=-8.0)
    assert oriented_phi(other, last.x, last.known)[index("rest_curvature")] == 0.0
    again = track_orientation(RODS, last.known, world(0).pushed(other), other)
    assert abs(again.log_odds) < abs(last.known.log_odds)


def test_nothing_is_followed_for_models_whose_effects_have_no_ends() -> None:
    made = world(1).pushed(CURVED)
    for model in (nominal_model(RODS), knowing(stiffness_bow=0.4)):
        assert track_orientation(RODS, UNKNOWN, made, model) is UNKNOWN
    points = model_with("rope_push", rest_curvature=6.0)
    assert track_orientation("rope_push", UNKNOWN, made, points) is UNKNOWN


def test_stiffness_along_the_rope_acts_in_its_prediction_by_the_end_that_is_first() -> None:
    phi = jit_cache.phi_of(knowing(stiffness_slope=0.9))
    here = world(1)
    path = jnp.asarray(TASK.actions.measured_path(here.way()))[None]
    simulate = jit_cache.action_simulator(RODS, COUNT, *jit_cache.needs(RODS, phi))
    ends = [
        np.asarray(simulate(jnp.asarray(with_orientation(phi, sign))[None], here.state, path).centreline[0])
        for sign in (1.0, 0.0, -1.0)
    ]
    reversed_ = RodState(here.state.nodes[..., ::-1] * MIRRORED, *here.state[1:])
    again = simulate(jnp.asarray(with_orientation(phi, -1.0))[None], reversed_, path).centreline[0, :, ::-1]
    np.testing.assert_allclose(ends[0], again, atol=2e-4)
    apart = np.linalg.norm(ends[0] - ends[2], axis=0).max()
    assert apart > 1e-3
    assert np.linalg.norm(ends[0] - ends[1], axis=0).max() < apart


def test_a_model_with_stiffness_along_the_rope_plans_whether_its_ends_are_known_or_not() -> None:
    model = knowing(stiffness_slope=0.9, stiffness_bow=0.4)
    x, goal = TASK.particles(TASK.start(0), COUNT), TASK.goal(0, COUNT)
    line, odd = canonical(x), (0.0, 0.0, pytest.approx(0.9))
    known = replace(track_orientation(RODS, UNKNOWN, world(0).pushed(model), model), line=line)
    assert known.odd_parameters == odd
    plans = [
        plan(RODS, "cpu", x, goal, model, 0, orientation=replace(known, log_odds=log_odds))
        for log_odds in (0.0, 5.0, -5.0)
    ]
    for found in plans:
        assert found.predicted_chamfer_m2 < 0.6 * found.chamfer_m2
    ways = [found.branches[0].final for found in plans]
    assert np.abs(ways[1] - ways[2]).max() > 1e-3
    assert np.abs(ways[0] - ways[1]).max() > 1e-4


def test_an_episode_follows_the_ends_of_its_rope_from_plan_to_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    model, found, told = knowing(stiffness_slope=0.9, stiffness_bow=0.4), list[Orientation](), list[Orientation]()
    follow, decide = worker_api.track_orientation, worker_api.plan

    def track(task: str, orientation: Orientation, made: Transition, by: Model) -> Orientation:
        found.append(follow(task, orientation, made, by))
        return found[-1]

    def planned(*decision: Any, orientation: Orientation, **rest: Any) -> Plan:
        told.append(orientation)
        return decide(*decision, orientation=orientation, **rest)

    monkeypatch.setattr(worker_api, "track_orientation", track)
    monkeypatch.setattr(worker_api, "plan", planned)
    order = EvaluationConfig(
        task=TASK, preset="cpu", seed=0, method=DIPAC, model=model, eyes="truth", actions=2, play_on=True
    )
    played = play(order)
    assert (played.failure, len(played.decision_s)) == ("", 2)
    assert told == [UNKNOWN, found[0]]
    assert all(known.log_odds != 0.0 for known in found)


def test_calibration_keeps_what_is_odd_and_fits_with_what_is_even() -> None:
    model, made = knowing(stiffness_slope=0.5, stiffness_bow=0.3), world(1).pushed(knowing(stiffness_bow=0.3))
    one, other = (update(RODS, "cpu", [made], each) for each in (model, knowing(stiffness_bow=0.3)))
    assert one.value("stiffness_slope") == 0.5
    assert one.value("stiffness") == pytest.approx(other.value("stiffness"), rel=1e-3)
