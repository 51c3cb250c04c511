"""Laws of ropes as rods."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError
from app.sim.rods.rollout import RodPhysics, SimulateRod, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState, bends, inextensible
from app.tasks.elements.curves import fill_tube
from tests.sim import pushed_ropes
from tests.sim.pushed_ropes import REACH_M, SCENE, assert_agree, central, crossing, curve, line_of, lying, straight

G = SCENE.gravity_m_s2
PARKED_POSE = (0.0, 0.0, 0.3)


@cache
def simulator(scene: RodScene = SCENE) -> SimulateRod:
    return make_rod_rollout(scene)


def physics(candidates: int = 1, scene: RodScene = SCENE, **values: float) -> RodPhysics:
    nominal = RodPhysics.nominal(scene, candidates)
    return nominal._replace(**{name: jnp.full(candidates, value) for name, value in values.items()})


def still(seconds: float, place: tuple[float, float, float] = PARKED_POSE) -> jax.Array:
    """A finger (1, T, 3) that stands."""
    return jnp.tile(jnp.asarray(place), (1, round(seconds / SCENE.dt_s) + 1, 1))


def test_a_span_of_a_path_is_what_the_same_part_of_it_would_be():
    given, state, tool = pushes()
    steps = tool.shape[1] - 1
    for first, last in ((0, steps), (20, steps - 30)):
        span = simulator()(given, state, tool, spans=jnp.tile(jnp.array([[first, last]]), (len(tool), 1)))
        part = simulator()(given, state, tool[:, first : last + 1])
        assert np.array_equal(span.nodes, part.nodes)


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_sliding_rope_stops_after_v_squared_over_2_mu_g(friction: float):
    speed = 0.5
    start = lying(curve(1.0))
    moving = start._replace(nodes=start.nodes.at[:, 3].set(speed))
    end = simulator()(physics(table_friction=friction), moving, still(1.0))
    slid = (line_of(end) - line_of(start)).mean(0)
    assert slid[1] == pytest.approx(speed**2 / (2 * friction * G), rel=0.02)
    assert slid[0] == pytest.approx(0.0, abs=1e-5)
    assert np.abs(end.nodes[:, 2:4]).max() < 1e-3


def test_a_free_rope_swings_at_the_frequency_of_a_free_beam():
    """4.730^2 / (2 pi L^2) sqrt(E I / m per length) (Rayleigh 1877, "The Theory of Sound", ch. 8)."""
    s = np.linspace(-0.5, 0.5, SCENE.nodes)
    k = 4.730041
    shape = np.cos(k * s) / np.cos(k / 2) + np.cosh(k * s) / np.cosh(k / 2)
    line = np.stack([SCENE.length_m * s, 0.004 * shape / shape.max()], axis=1)
    start = lying(line)
    start = start._replace(nodes=start.nodes.at[:, 7].set(0.0))
    free = physics(table_friction=1e-6, viscosity=1e-8, yield_curvature=1e3)
    rate = k**2 / SCENE.length_m**2 * np.sqrt(6e-5 / (0.064 / 0.40))
    half = simulator()(free, start, still(np.pi / rate))
    before, after = (line[:, 1] @ shape, line_of(half)[:, 1] @ shape)
    assert after / before == pytest.approx(-1.0, abs=0.05)


def test_a_rope_at_rest_stays_and_gains_no_energy():
    bent = lying(curve(2.0))
    bent = bent._replace(nodes=bent.nodes.at[:, 7].multiply(0.97))  # A little stress, which friction holds.
    end = simulator()(physics(), bent, still(2.0))
    assert np.abs(line_of(end) - line_of(bent)).max() < 5e-4
    assert np.abs(end.nodes[:, 2:4]).max() < 1e-4


def test_what_is_pushed_at_its_centre_does_not_turn_and_at_its_end_does():
    at_centre = simulator()(physics(), lying(curve(0.0)), straight((0.0, -0.03), (0.0, 0.1), 0.6))
    at_end = simulator()(physics(), lying(curve(0.0)), straight((0.15, -0.03), (0.0, 0.1), 0.6))
    middle, end = line_of(at_centre), line_of(at_end)
    assert middle[:, 1] == pytest.approx(middle[::-1, 1], abs=1e-4)
    assert middle[SCENE.nodes // 2, 1] == pytest.approx(0.03 + REACH_M, abs=1.5e-3)
    assert end[-1, 1] - end[0, 1] > 0.02


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_finger_and_rope_do_not_pass_through_each_other(speed: float):
    start = lying(curve(0.6))
    for seconds in np.linspace(0.1, 0.1 / speed, 4):
        end = simulator()(physics(), start, straight((0.02, -0.05), (0.0, speed), float(seconds)))
        finger = np.array([0.02, -0.05 + speed * seconds])
        line = line_of(end)
        ends = np.stack([line[:-1], line[1:]])
        share = np.linspace(0, 1, 21)[:, None, None]
        gap = np.linalg.norm(ends[0] + share * (ends[1] - ends[0]) - finger, axis=-1).min()
        assert gap > REACH_M - 2e-3


def test_strands_of_a_rope_do_not_pass_through_each_other():
    """A hairpin, one strand of which is pushed against the other at 0.3 m/s."""
    half = np.arange(SCENE.nodes // 2) * SCENE.rest_m
    radius = 0.03
    turn = np.linspace(-np.pi / 2, np.pi / 2, 9)[1:-1]
    arc = np.stack([0.16 + radius * np.cos(turn), radius * np.sin(turn)], 1)
    line = np.concatenate(
        [np.stack([half[:17], np.full(17, -radius)], 1), arc, np.stack([half[16::-1], np.full(17, radius)], 1)]
    )
    state = lying(np.asarray(inextensible(jnp.asarray(line.T[None], jnp.float32), SCENE.rest_m))[0].T)
    end = line_of(simulator()(physics(), state, straight((0.05, -0.06), (0.0, 0.3), 0.25)))
    one, other = end[:12], end[-12:]
    assert other[:, 1].mean() > 0.03
    assert np.linalg.norm(one[:, None] - other[None], axis=-1).min() > 2 * SCENE.radius_m - 3e-3


def test_a_mirror_image_moves_like_a_mirror_image_and_either_end_may_be_the_first():
    start, path = curve(1.5), straight((0.06, -0.09), (0.02, 0.12), 0.9)
    mirrored = path * jnp.array([-1.0, 1.0, 1.0])
    end = line_of(simulator()(physics(), lying(start), path))
    mirror = line_of(simulator()(physics(), lying(start * [-1, 1]), mirrored))
    turned = line_of(simulator()(physics(), lying(start[::-1]), path))
    assert np.linalg.norm(end - start, axis=1).max() > 0.03
    assert mirror * [-1, 1] == pytest.approx(end, abs=5e-5)
    assert turned[::-1] == pytest.approx(end, abs=5e-5)


def test_half_the_time_step_and_twice_the_nodes_change_little():
    ends = list[np.ndarray]()
    for scene in (SCENE, replace(SCENE, dt_s=5e-4), replace(SCENE, spacing_m=0.005, dt_s=5e-4)):
        steps = round(0.9 / scene.dt_s)
        t = np.linspace(0, 0.9, steps + 1)
        path = np.stack([np.full(len(t), 0.07), -0.09 + 0.12 * t, np.full(len(t), 0.006)], 1)[None]
        end = line_of(simulator(scene)(physics(scene=scene), lying(curve(1.0, scene)), jnp.asarray(path)))
        ends.append(end[:: (scene.nodes - 1) // (SCENE.nodes - 1)])
    assert np.linalg.norm(ends[0] - curve(1.0), axis=1).mean() > 0.01
    assert np.linalg.norm(ends[1] - ends[0], axis=1).mean() < 2e-4
    assert np.linalg.norm(ends[2] - ends[0], axis=1).mean() < 2e-3


def test_beyond_its_yield_curvature_a_rope_keeps_its_bend_and_below_it_straightens():
    bent = lying(curve(1.0))
    bent = bent._replace(nodes=bent.nodes.at[:, 7].set(0.0))  # Elastic: 2.5 / m everywhere.
    slippery = physics(table_friction=1e-3, viscosity=3e-6)
    straightened = simulator()(slippery, bent, still(3.0))
    kept = simulator()(slippery._replace(yield_curvature=jnp.full(1, 1.0)), bent, still(3.0))
    assert np.abs(bends(straightened.nodes[:, :2])).mean() < 0.2 * 2.5 * SCENE.rest_m
    assert np.asarray(bends(kept.nodes[:, :2])).mean() == pytest.approx(1.5 * SCENE.rest_m, rel=0.15)


# Gradients.

PUSHES = 24


@cache
def pushes() -> tuple[RodPhysics, RodState, jax.Array]:
    """Ropes and fingers that go through them, at random."""
    rng = np.random.default_rng(3)
    lines = [curve(rng.uniform(-3, 3)) for _ in range(PUSHES)]
    paths = []
    for line in lines:
        where, way = crossing(rng, line)
        paths.append(straight(where - 0.03 * way, 0.12 * way, 0.9)[0])
    return physics(PUSHES, creep=1e-3), lying(*lines), jnp.stack(paths)


def cost(given: RodPhysics, state: RodState, tool: jax.Array) -> jax.Array:
    """Cost (B,) of squared distances [cm^2] from each rope's start, shifted."""
    return pushed_ropes.cost(simulator(), given, state, tool, state)


@cache
def slopes() -> tuple[RodPhysics, RodState, jax.Array]:
    def total(given: RodPhysics, state: RodState, tool: jax.Array) -> jax.Array:
        return cost(given, state, tool).sum()

    return jax.grad(total, argnums=(0, 1, 2))(*pushes())


@pytest.mark.parametrize(
    "name", ["rigidity", "table_friction", "finger_friction", "viscosity", "yield_curvature", "mass"]
)
def test_gradients_of_parameters_equal_central_differences(name: str):
    given, state, tool = pushes()
    value = getattr(given, name)
    slope = np.asarray(getattr(slopes()[0], name) * value, np.float64)

    def change(amount: float):
        return given._replace(**{name: value * (1 + amount)}), state, tool

    assert_agree(slope, [central(cost, change, step) for step in (1e-3, 4e-3)])


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("part", ["path", "turn", "start", "velocity"])
def test_gradients_of_action_and_state_equal_central_differences(part: str, axis: int):
    given, state, tool = pushes()
    ramp = jnp.linspace(0, 1, tool.shape[1])

    def change(amount: float):
        match part:
            case "path":
                return given, state, tool.at[:, :, axis].add(amount)
            case "turn":
                return given, state, tool.at[:, :, axis].add(amount * ramp)
            case "start":
                return given, state._replace(nodes=state.nodes.at[:, axis].add(amount)), tool
            case _:
                return given, state._replace(nodes=state.nodes.at[:, 2 + axis].add(amount)), tool

    bars = slopes()
    slope = {
        "path": bars[2][:, :, axis].sum(1),
        "turn": (bars[2][:, :, axis] * ramp).sum(1),
        "start": bars[1].nodes[:, axis].sum(1),
        "velocity": bars[1].nodes[:, 2 + axis].sum(1),
    }[part]
    goal_moves = np.zeros(PUSHES)
    if part == "start":
        # The goal goes with the start in the differences, and not in the gradient.
        end = simulator()(given, state, tool).nodes[:, :2]
        goal = state.nodes[:, :2] + jnp.array([0.03, 0.02])[:, None]
        goal_moves = np.asarray(-1e4 * (end - goal)[:, axis].sum(1) / SCENE.nodes, np.float64)
    step = {"path": 1e-4, "turn": 1e-4, "start": 1e-4, "velocity": 3e-3}[part]
    assert_agree(np.asarray(slope, np.float64) + goal_moves, [central(cost, change, size) for size in (step, step / 3)])


# Particles.


def test_particles_of_a_tube_are_where_they_were_and_go_with_the_rope():
    line = np.concatenate([curve(1.2), np.full((SCENE.nodes, 1), 0.008)], 1)
    x = fill_tube(line, SCENE.radius_m, 300)
    state = RodState.at_rest(jnp.asarray(x)[None], SCENE.nodes, SCENE.rest_m)
    assert np.asarray(state.x[0]) == pytest.approx(x, abs=1e-5)
    found = line_of(state)
    found = found if np.linalg.norm(found[0] - line[0, :2]) < 0.1 else found[::-1]
    assert np.linalg.norm(found - line[:, :2], axis=1).mean() < 1.5e-3
    assert np.linalg.norm(np.diff(found, axis=0), axis=1) == pytest.approx(
        np.full(SCENE.nodes - 1, SCENE.rest_m), rel=1e-4
    )
    moved = state._replace(nodes=state.nodes.at[:, 0].add(0.1))
    assert np.asarray(moved.x - state.x)[0] == pytest.approx(np.tile([0.1, 0, 0], (300, 1)), abs=1e-5)


def test_a_candidate_that_is_not_finite_is_nan_and_leaves_the_others_alone():
    given, state, tool = pushes()
    broken = tool.at[5, 40, 0].set(jnp.nan)
    ends = simulator()(given, state, broken).nodes, simulator()(given, state, tool).nodes
    assert np.isnan(ends[0][5]).all()
    assert np.array_equal(np.delete(ends[0], 5, 0), np.delete(ends[1], 5, 0))


def test_a_batch_equals_its_candidates_one_by_one():
    given, state, tool = pushes()
    together = simulator()(given, state, tool).nodes
    for b in (0, 7, PUSHES - 1):
        alone = slice(b, b + 1)
        one = RodPhysics(*(value[alone] for value in given)), RodState(*(part[alone] for part in state)), tool[alone]
        assert np.array_equal(simulator()(*one).nodes[0], together[b])


@pytest.mark.parametrize(
    ("field", "value"), [("length_m", -0.4), ("radius_m", 0.0), ("mass_kg", np.nan), ("dt_s", 0.02), ("spacing_m", 1.0)]
)
def test_a_scene_that_cannot_be_is_refused_by_name(field: str, value: float):
    with pytest.raises(ParameterError, match=field):
        replace(SCENE, **{field: value})
