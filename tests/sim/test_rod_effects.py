"""Conformance of effects on rods, found by itself in the catalogue: null, gradient, bounds, physics of particles."""

import re
from functools import cache
from itertools import accumulate
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import warp as wp

from app.core.errors import ParameterError
from app.sim.effects.base import NodeContext, ParticleContext
from app.sim.model.catalogue import discover
from app.sim.model.params import rod_parameters_of
from app.sim.rods.effect import RodContext, RodProperties, RodSetting
from app.sim.rods.rollout import RodPhysics, SimulateRod, make_rod_rollout
from app.sim.rods.scene import RodScene, numbers_of
from app.sim.rods.state import RodState

CATALOGUE = {name: effect for name, effect in discover().items() if effect.rod is not None}
"""The effects that act on rods."""
EFFECTS = tuple(CATALOGUE.values())
SPECS = [spec for effect in EFFECTS for spec in effect.parameters]
FIRST = dict(zip(CATALOGUE, accumulate((len(effect.parameters) for effect in EFFECTS), initial=0), strict=False))
LOW, NULL, HIGH = (np.array([getattr(spec, end) for spec in SPECS]) for end in ("low", "nominal", "high"))
SPAN = HIGH - LOW
HIGHEST = np.maximum(HIGH, [spec.high for spec in rod_parameters_of(EFFECTS)])
SCENE = RodScene(length_m=0.40, radius_m=0.008, mass_kg=0.064, finger_radius_m=0.009)
MIDDLE = np.array([0.55, 0.0])
"""Middle of the workspace, about which the ropes lie."""
PUSHES, STEPS = 16, 300
every_effect = pytest.mark.parametrize("name", CATALOGUE)


def index(parameter: str) -> int:
    """The column of a parameter."""
    return [spec.name for spec in SPECS].index(parameter)


def columns(name: str) -> range:
    """Columns of an effect's parameters."""
    return range(FIRST[name], FIRST[name] + len(CATALOGUE[name].parameters))


def switches(name: str) -> list[int]:
    """Columns that switch an effect off."""
    effect = CATALOGUE[name]
    return list(columns(name))[: effect.switches]


@cache
def simulator(*, acts: bool = True) -> SimulateRod:
    """Simulator with all effects in one module, or with none."""
    return jax.jit(make_rod_rollout(SCENE, EFFECTS if acts else ()))


def arc(turn_rad: float, scene: RodScene = SCENE) -> np.ndarray:
    """Nodes (n, 2) of constant curvature about the origin."""
    heading = turn_rad * (np.arange(scene.nodes - 1) / (scene.nodes - 2) - 0.5)
    line = np.concatenate([np.zeros((1, 2)), np.cumsum(np.stack([np.cos(heading), np.sin(heading)], 1), 0)])
    return scene.rest_m * (line - line.mean(0))


def lying(lines: np.ndarray, velocity: np.ndarray | float = 0.0) -> RodState:
    """Ropes (B, n, 2) free of stress, with one velocity (B, 2) each."""
    state = RodState.along(jnp.asarray(lines.transpose(0, 2, 1), jnp.float32))
    v = np.broadcast_to(np.asarray(velocity, np.float32), (len(lines), 2))
    return state._replace(nodes=state.nodes.at[:, 2:4].set(jnp.asarray(v)[:, :, None]))


@cache
def pushes() -> tuple[RodPhysics, RodState, jax.Array, RodSetting]:
    """Curved ropes under stress that slide, half of them on ice; a finger pushes each for a while and stops."""
    rng = np.random.default_rng(4)
    lines = np.stack([arc(rng.uniform(-3, 3)) + MIDDLE + rng.uniform(-0.02, 0.02, 2) for _ in range(PUSHES)])
    state = lying(lines, rng.uniform(-0.15, 0.15, (PUSHES, 2)))
    state = state._replace(nodes=state.nodes.at[:, 7].multiply(0.6))
    ways = np.stack([[np.cos(a), np.sin(a)] for a in rng.uniform(0, 2 * np.pi, PUSHES)])
    met = lines[np.arange(PUSHES), rng.integers(4, SCENE.nodes - 4, PUSHES)]
    along = 0.25 * SCENE.dt_s * np.minimum(np.arange(STEPS + 1), STEPS * 3 // 4) - 0.022
    path = met[:, None] + along[:, None] * ways[:, None]
    tool = np.concatenate([path, np.full((PUSHES, STEPS + 1, 1), 0.006)], axis=2)
    friction = jnp.where(jnp.arange(PUSHES) % 2 == 0, 0.5, 0.03)
    physics = RodPhysics.nominal(SCENE, PUSHES)._replace(creep=jnp.full(PUSHES, 1e-3), table_friction=friction)
    return physics, state, jnp.asarray(tool, jnp.float32), known(PUSHES, 0.3)


def known(count: int, time: float) -> RodSetting:
    """Ropes whose first node is their first end."""
    along = jnp.linspace(-1, 1, SCENE.nodes)
    return RodSetting(material_coordinates=jnp.tile(along, (count, 1)), session_time=jnp.full(count, time))


def typical() -> np.ndarray:
    """All effects at once: switches at a seventh of their ranges, the rest a little beside their nominal values."""
    phi = NULL.copy()
    for name in CATALOGUE:
        for column in columns(name):
            end = HIGH[column] if HIGH[column] > phi[column] else LOW[column]
            phi[column] += (0.15 if column in switches(name) else 0.02) * (end - phi[column])
    return phi


POINTS = {"null": NULL, "typical": typical()}
every_point = pytest.mark.parametrize("point", POINTS)


def weights() -> jax.Array:
    """Random weights (2, B, 2, n), by which the differentiated value is a sum in which nothing cancels."""
    return jnp.asarray(np.random.default_rng(5).normal(0.5, 1.0, (2, PUSHES, 2, SCENE.nodes)), jnp.float32)


def value(end: RodState) -> jax.Array:
    """A weighted sum of positions [mm] and velocities [dm/s] of each push."""
    w, u = weights()
    copies = len(end.nodes) // PUSHES
    many = (copies, PUSHES, 2, SCENE.nodes)
    x, v = end.nodes[:, :2].reshape(many), end.nodes[:, 2:4].reshape(many)
    x = x - pushes()[1].nodes[:, :2]
    return (1e3 * (w * x).mean((2, 3)) + 1e1 * (u * v).mean((2, 3))).reshape(-1)


def ends(phi: np.ndarray, steps: int = STEPS) -> RodState:
    """State at the end of all pushes for each row of phi, one row after the other."""

    def many(part: jax.Array) -> jax.Array:
        return jnp.tile(part, (len(phi), *(1,) * (part.ndim - 1)))

    physics, state, tool, setting = jax.tree.map(many, pushes())
    tool = tool[:, : steps + 1]
    return simulator()(physics, state, tool, jnp.asarray(np.repeat(phi, PUSHES, axis=0), jnp.float32), setting)


@cache
def gradient(point: str) -> np.ndarray:
    """Gradient of the value of each push (B, P), by one backward pass."""
    physics, state, tool, setting = pushes()

    def total(phi: jax.Array) -> jax.Array:
        return value(simulator()(physics, state, tool, phi, setting)).sum()

    phi = jnp.tile(jnp.asarray(POINTS[point], jnp.float32), (PUSHES, 1))
    return np.asarray(jax.grad(total)(phi), np.float64)


STEPS_OF_SPAN = (2.5e-4, 1e-3, 4e-3, 1.5e-2, 6e-2)
CENTRAL, ONE_SIDED = np.array([1 / 12, -2 / 3, 2 / 3, -1 / 12]), np.array([-7 / 4, 8 / 3, -1, 1 / 12])
"""Weights of the values at -2, -1, 1 and 2, or at 0, 1, 2 and 4 steps, in a slope of fourth order (Fornberg 1988)."""


@cache
def differences(point: str) -> np.ndarray:
    """Gradient (5, B, P) by differences with five sizes of steps; one-sided where the range ends."""
    phi, step = POINTS[point], np.array(STEPS_OF_SPAN)[:, None] * SPAN
    up, down = (phi + 4 * step <= HIGH)[..., None], (phi - 4 * step >= LOW)[..., None]
    side = np.where(up, 1, -1)
    offsets = np.where(up & down, [-2, -1, 1, 2], side * np.array([0, 1, 2, 4]))
    shares = np.where(up & down, CENTRAL, side * ONE_SIDED)
    rows = phi + (offsets * step[..., None])[..., None] * np.eye(len(phi))[:, None, :]
    values = np.asarray(value(ends(rows.reshape(-1, len(phi)))), np.float64)
    slopes = (shares[..., None] * values.reshape(*offsets.shape, PUSHES)).sum(2) / step[..., None]
    return slopes.transpose(0, 2, 1)


def test_with_all_switches_at_their_null_values_it_is_the_nominal_model():
    rng = np.random.default_rng(0)
    phi = LOW + rng.random((4, len(SPECS))) * SPAN
    off = [column for name in CATALOGUE for column in switches(name)]
    phi[:, off] = NULL[off]
    physics, state, tool, _ = pushes()
    nominal = np.asarray(simulator(acts=False)(physics, state, tool).nodes)
    for ours in np.asarray(ends(phi).nodes).reshape(4, *nominal.shape):
        assert np.abs(ours - nominal)[:, :2].max() < 1e-6


def test_at_the_null_the_backward_pass_is_the_nominal_models_too():
    physics, state, tool, setting = pushes()

    def bars(simulate: SimulateRod, *more: object):
        def total(physics: RodPhysics, state: RodState, tool: jax.Array) -> jax.Array:
            return value(simulate(physics, state, tool, *more)).sum()

        return jax.tree.leaves(jax.grad(total, argnums=(0, 1, 2))(physics, state, tool))

    null = jnp.tile(jnp.asarray(NULL, jnp.float32), (PUSHES, 1))
    for our, their in zip(bars(simulator(), null, setting), bars(simulator(acts=False)), strict=True):
        assert np.abs(our - their).max() <= 1e-3 * np.abs(their).max()


@every_point
@every_effect
def test_its_gradient_is_finite_and_equals_differences(name: str, point: str):
    """Equal in nearly all pushes for one of the steps: few pushes are at a kink, and small steps drown in rounding."""
    for column in columns(name):
        slope = gradient(point)[:, column] * SPAN[column]
        expected = differences(point)[..., column] * SPAN[column]
        assert np.isfinite(slope).all()
        floor = 2e-2 * np.abs(expected).max(1, keepdims=True) + 1e-2
        off = np.abs(slope - expected) - np.maximum(0.1 * np.abs(expected), floor)
        assert (off.min(0) <= 0).mean() >= 0.85, (SPECS[column].name, slope, expected)


@every_effect
def test_one_of_its_switches_has_a_response(name: str):
    """Response at the null, or at a typical size where its physics is one-sided there."""
    found = max(np.abs(differences(point)[-1] * SPAN)[:, switches(name)].max() for point in POINTS)
    assert found > 0.02


@every_effect
def test_it_stays_finite_up_to_the_ends_of_its_ranges(name: str):
    for end in (LOW, HIGH):
        assert np.isfinite(at_the_ends(end is HIGH)[list(columns(name))]).all()


@cache
def at_the_ends(upper: bool) -> np.ndarray:
    """The fastest node's speed (P,) [m/s] after 0.15 s with one parameter at its lower or upper end."""
    end = HIGHEST if upper else LOW
    nodes = np.asarray(ends(NULL + np.diag(end - NULL), STEPS // 2).nodes)
    return np.abs(nodes[:, 2:4]).max((1, 2)).reshape(-1, PUSHES).max(1)


# The same physics as that of material points: one law, written for each of the two.

THIN = RodScene(length_m=0.40, radius_m=5e-4, mass_kg=0.064, finger_radius_m=0.009)
"""A rope so limp that its nodes move independently, and so thin that they are almost on the table."""
PARKED_POSE = (0.0, 0.0, 0.3)
G = SCENE.gravity_m_s2
TIME = 0.2


@cache
def thin_simulator() -> SimulateRod:
    return jax.jit(make_rod_rollout(THIN, EFFECTS))


def with_random(name: str, count: int) -> np.ndarray:
    """Parameters (B, P), those of one effect at random in their ranges and near the rope, the others at their nulls."""
    phi, own, rng = np.tile(NULL, (count, 1)), list(columns(name)), np.random.default_rng(6)
    phi[:, own] = LOW[own] + rng.random((count, len(own))) * SPAN[own]
    places = [column for column in own if SPECS[column].unit == "m"]
    phi[:, places] = NULL[places] + rng.uniform(-0.05, 0.05, (count, len(places)))
    return phi


def at_nodes(name: str, hook: str, phi: np.ndarray, x: np.ndarray, v: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Values that an effect's Warp function returns for `value` (M, D) at x (M, 3), velocities v (M, 3), phi (M, P)."""
    function = getattr(CATALOGUE[name], hook)
    Value = wp.vec3 if hook == "node_velocity" else float
    Phi = wp.types.vector(length=phi.shape[1], dtype=float)

    @wp.kernel(module="unique", enable_backward=False)
    def changed(
        values: wp.array[Value], x: wp.array[wp.vec3], v: wp.array[wp.vec3], phi: wp.array[Phi], out: wp.array[Value]
    ):
        i = wp.tid()
        node = NodeContext()
        node.x = x[i]
        node.v = v[i]
        node.dt = wp.static(THIN.dt_s)
        node.gravity = wp.static(G)
        node.time = wp.static(TIME)
        out[i] = function(values[i], node, phi[i], 0)

    given = [
        wp.array(np.float32(part), dtype=kind)
        for part, kind in ((value, Value), (x, wp.vec3), (v, wp.vec3), (phi, Phi))
    ]
    out = wp.zeros(len(x), dtype=Value)
    wp.launch(changed, len(x), [*given, out])
    return out.numpy()


def scattered() -> tuple[np.ndarray, np.ndarray]:
    """Straight ropes (B, n, 2) about the middle of the workspace, and a velocity of each."""
    rng = np.random.default_rng(7)
    turns = [np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a in rng.uniform(0, 2 * np.pi, PUSHES)]
    lines = np.stack([arc(0.0, THIN) @ turn + MIDDLE + rng.uniform(-0.05, 0.05, 2) for turn in turns])
    return lines, rng.uniform(-0.4, 0.4, (PUSHES, 2))


def after_one_step(phi: np.ndarray, friction: float, z: np.ndarray | float = 0.0) -> np.ndarray:
    """Changes of the nodes' velocities (B, n, 2) [m/s], with bristles of the table at z (B, 2, n)."""
    lines, v = scattered()
    state = lying(lines, v)
    state = state._replace(nodes=state.nodes.at[:, 4:6].set(jnp.asarray(z, jnp.float32)))
    physics = RodPhysics.nominal(THIN, PUSHES)._replace(table_friction=jnp.full(PUSHES, friction))
    tool = jnp.tile(jnp.asarray(PARKED_POSE), (PUSHES, 2, 1))
    end = thin_simulator()(physics, state, tool, jnp.asarray(phi, jnp.float32), known(PUSHES, TIME))
    return np.asarray(end.nodes[:, 2:4] - state.nodes[:, 2:4], np.float64).transpose(0, 2, 1)


def at_the_null(friction: float, z: np.ndarray | float = 0.0) -> np.ndarray:
    """Changes of velocity without the effect: from positions that rounding has stretched, and from even friction."""
    return after_one_step(np.tile(NULL, (PUSHES, 1)), friction, z)


def samples(name: str, phi: np.ndarray, height_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parameters, places and velocities of all nodes of the scattered ropes."""
    lines, v = scattered()
    own = np.repeat(phi[:, list(columns(name))], THIN.nodes, axis=0)
    x = np.concatenate([lines.reshape(-1, 2), np.full((len(own), 1), height_m)], axis=1)
    return own, x, np.concatenate([np.repeat(v, THIN.nodes, axis=0), np.zeros((len(own), 1))], axis=1)


def which_have(*hooks: str) -> list[str]:
    return [name for name, effect in CATALOGUE.items() if any(getattr(effect, hook) is not None for hook in hooks)]


@pytest.mark.parametrize("name", which_have("node_velocity"))
def test_a_node_is_moved_as_a_node_of_the_grid_is(name: str):
    phi = with_random(name, PUSHES)
    heights = THIN.radius_m * (1 + np.cos(np.pi * np.arange(1, 10) / 10))
    shares = 0.2 * np.sin(np.pi * np.arange(1, 10) / 10) ** 2
    expected = np.zeros((PUSHES * THIN.nodes, 3))
    for height, share in zip(heights, shares, strict=True):
        own, x, v = samples(name, phi, height)
        expected += share * (at_nodes(name, "node_velocity", own, x, v, v) - v)
    changes = (after_one_step(phi, 1e-6) - at_the_null(1e-6)).reshape(-1, 2)
    size = np.abs(expected).max()
    assert size > 1e-6
    assert np.abs(changes - expected[:, :2]).max() < 0.01 * size + 2e-7


@pytest.mark.parametrize("name", which_have("table_friction"))
def test_the_table_rubs_as_it_does_on_a_node_of_the_grid(name: str):
    """Bristles start as they are in even sliding: a step takes mu g dt off the speed."""
    phi, friction = with_random(name, PUSHES), 0.4
    own, x, v = samples(name, phi, THIN.radius_m)
    mu = at_nodes(name, "table_friction", own, x, v, np.full(len(x), friction)).reshape(PUSHES, THIN.nodes)
    way = scattered()[1] / np.linalg.norm(scattered()[1], axis=1, keepdims=True)
    bristles = way[:, :, None] * THIN.masses() * G / numbers_of(THIN, 0.0).table
    more = at_the_null(friction, friction * bristles) - after_one_step(phi, friction, mu[:, None] * bristles)
    assert np.ptp(mu) > 0.05
    assert (more * way[:, None]).sum(2) == pytest.approx((mu - friction) * G * THIN.dt_s, abs=2e-5)
    assert np.abs(more[..., 0] * way[:, None, 1] - more[..., 1] * way[:, None, 0]).max() < 2e-5


def of_particles(name: str, hook: str, phi: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Values that an effect's Warp function returns for 1 at places s (M,) along the object."""
    function = getattr(CATALOGUE[name], hook)
    Phi = wp.types.vector(length=phi.shape[1], dtype=float)

    @wp.kernel(module="unique", enable_backward=False)
    def changed(s: wp.array[float], phi: wp.array[Phi], out: wp.array[float]):
        i = wp.tid()
        grain = ParticleContext()
        grain.label = wp.vec4(s[i], 0.0, 0.0, 0.0)
        grain.time = wp.static(TIME)
        out[i] = function(wp.static(1.0), grain, phi[i], 0)

    out = wp.zeros(len(s), dtype=float)
    wp.launch(changed, len(s), [wp.array(np.float32(s)), wp.array(np.float32(phi), dtype=Phi), out])
    return out.numpy()


OF_HOOK = {"mass": "mass", "stiffness": "rigidity", "tool_friction": "finger_friction"}
"""Property of a rod that each hook of particles scales."""


def properties() -> RodProperties:
    """Properties of rods, all of them 1."""
    per_node, one = jnp.ones((PUSHES, SCENE.nodes)), jnp.ones(PUSHES)
    return RodProperties(per_node, per_node, per_node, one, one, one, one, one)


def changed(name: str, phi: np.ndarray, setting: RodSetting) -> RodProperties:
    effect = CATALOGUE[name]
    assert effect.rod is not None
    assert effect.rod.properties is not None
    own = jnp.asarray(phi[:, list(columns(name))], jnp.float32)
    return effect.rod.properties(properties(), RodContext(scene=SCENE, setting=setting), own)


@pytest.mark.parametrize("name", which_have(*OF_HOOK))
def test_properties_change_as_those_of_particles_do(name: str):
    phi = with_random(name, PUSHES)
    ours = changed(name, phi, known(PUSHES, TIME))
    s = np.tile(np.linspace(-1, 1, SCENE.nodes), PUSHES)
    own = np.repeat(phi[:, list(columns(name))], SCENE.nodes, axis=0)
    for hook in OF_HOOK:
        if getattr(CATALOGUE[name], hook) is not None:
            theirs = of_particles(name, hook, own, s).reshape(PUSHES, SCENE.nodes)
            mine = np.asarray(getattr(ours, OF_HOOK[hook]))
            assert np.ptp(theirs) > 0.05
            assert np.broadcast_to(mine.reshape(PUSHES, -1), theirs.shape) == pytest.approx(theirs, rel=1e-4)


@pytest.mark.parametrize("name", ["mass_heterogeneity", "stiffness_heterogeneity", "rest_curvature"])
def test_without_knowing_which_end_is_the_first_nothing_changes(name: str):
    for mine, whole in zip(
        changed(name, with_random(name, PUSHES), RodSetting.unknown(PUSHES, SCENE.nodes)), properties(), strict=True
    ):
        assert np.array_equal(mine, whole)


# Laws that one would see.

SPEED = 0.4


def run(start: RodState, model: dict[str, float], seconds: float, *, time: float = 0.0, **physics: float) -> np.ndarray:
    """Nodes (n, 2) after so many seconds without a finger."""
    phi = NULL.copy()
    for parameter, size in model.items():
        phi[index(parameter)] = size
    given = {name: jnp.full(1, size) for name, size in physics.items()}
    tool = jnp.tile(jnp.asarray(PARKED_POSE), (1, round(seconds / SCENE.dt_s) + 1, 1))
    rod = RodPhysics.nominal(SCENE, 1)._replace(**given)
    end = simulator()(rod, start, tool, jnp.asarray(phi[None], jnp.float32), known(1, time))
    return np.asarray(end.nodes[0, :2], np.float64).T


def still(turn_rad: float = 0.0, velocity: tuple[float, float] = (0.0, 0.0), place: np.ndarray = MIDDLE) -> RodState:
    return lying((arc(turn_rad) + place)[None], np.array([velocity]))


def slide(model: dict[str, float], velocity: tuple[float, float] = (0.0, SPEED), time: float = 0.0) -> np.ndarray:
    """Displacement (2,) [m] of a straight rope along x that slides until it stops."""
    return (run(still(velocity=velocity), model, 0.4, time=time, table_friction=0.4) - arc(0.0) - MIDDLE).mean(0)


SLIDE_M = SPEED**2 / (2 * 0.4 * G)


@pytest.mark.parametrize(
    ("model", "factor"),
    [
        ({"friction_drift": 0.6}, 1.3),
        ({"friction_step": 0.5, "step_time": 0.0}, np.exp(0.25 * 0.5 / 0.51)),
        ({"anisotropy_axes": 0.3}, 0.7),
        ({"stribeck_excess": 0.5, "stribeck_speed": 2.0}, 1.49),
    ],
    ids=["drift", "step", "anisotropy", "stribeck"],
)
def test_a_rope_slides_v_squared_over_twice_mu_g(model: dict[str, float], factor: float):
    assert slide({}, time=0.5)[1] == pytest.approx(SLIDE_M, rel=0.02)
    assert slide(model, time=0.5)[1] == pytest.approx(SLIDE_M / factor, rel=0.04)


def test_on_a_tilted_table_a_rope_drifts_downhill_by_g_sin_a_t_squared_over_2():
    seconds, angle = 0.3, 4.0
    drop = G * np.sin(np.radians(angle)) * seconds**2 / 2
    raised, lowered = (run(still(), {name: angle}, seconds, table_friction=1e-6) for name in ("tilt_x", "tilt_y"))
    assert (raised - arc(0.0) - MIDDLE).mean(0) == pytest.approx([0.0, -drop], abs=0.01 * drop)
    assert (lowered - arc(0.0) - MIDDLE).mean(0) == pytest.approx([drop, 0.0], abs=0.01 * drop)


def test_a_film_stops_a_rope_after_v_over_c():
    """c is the film's, times the average nearness of the rope's cross section to the table: 1 - 8 mm / 20 mm."""
    end = run(still(velocity=(0.0, 0.2)), {"film_drag": 20.0}, 1.0, table_friction=1e-6)
    assert (end - arc(0.0) - MIDDLE)[:, 1].mean() == pytest.approx(0.2 / (0.6 * 20.0), rel=0.02)


def test_a_point_constraint_holds_a_rope_at_its_spot_and_lets_the_rest_go_on():
    pin = {"constraint_rate": 2000.0, "constraint_x": 0.55}
    moved = (run(still(velocity=(0.0, 0.2)), pin, 0.1, table_friction=1e-3) - arc(0.0) - MIDDLE)[:, 1]
    assert abs(moved[SCENE.nodes // 2]) < 0.002
    assert moved[[0, -1]].min() > 0.01


@pytest.mark.parametrize("rate", [1000.0, 5000.0])
def test_a_hidden_obstacle_stops_what_comes_and_lets_go_what_leaves(rate: float):
    post = {"obstacle_rate": rate, "obstacle_x": 0.55, "obstacle_y": 0.05}
    coming = (run(still(velocity=(0.0, 0.2)), post, 0.3, table_friction=1e-3) - arc(0.0) - MIDDLE)[:, 1]
    leaving = (run(still(velocity=(0.0, -0.2)), post, 0.3, table_friction=1e-3) - arc(0.0) - MIDDLE)[:, 1]
    assert coming[SCENE.nodes // 2] < 0.045
    assert coming[[0, -1]].min() > 0.05
    assert leaving[SCENE.nodes // 2] == pytest.approx(-0.06, rel=0.03)


def curvature(line: np.ndarray) -> float:
    """Mean curvature [1/m], positive to the left."""
    way = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
    return float((way[-1] - way[0]) / (SCENE.length_m - SCENE.rest_m))


def test_a_rope_with_rest_curvature_curls_to_its_left():
    for size in (-4.0, 4.0):
        line = run(still(), {"rest_curvature": size, "film_drag": 10.0}, 6.0, table_friction=1e-4)
        assert curvature(line) == pytest.approx(size, rel=0.05)


def sprung() -> RodState:
    """An elastic arc that is let go, of curvature 2.5 / m."""
    start = still(1.0)
    return start._replace(nodes=start.nodes.at[:, 7].set(0.0))


def test_internal_viscosity_damps_the_swing_of_a_free_beam():
    """exp(-c b^4 t / 2 rho) with b = 4.730 / L, mass per length rho and c = (2 + 4 nu^2) eta I, nu = 0.2."""
    scene = RodScene(length_m=0.12, radius_m=0.008, mass_kg=0.0192, finger_radius_m=0.009)
    s, k, eta, seconds = np.linspace(-0.5, 0.5, scene.nodes), 4.730041, 20.0, 0.62
    shape = np.cos(k * s) / np.cos(k / 2) + np.cosh(k * s) / np.cosh(k / 2)
    start = lying((np.stack([scene.length_m * s, 0.002 * shape / shape.max()], 1) + MIDDLE)[None])
    start = jax.tree.map(lambda part: jnp.repeat(part, 2, axis=0), start._replace(nodes=start.nodes.at[:, 7].set(0.0)))
    phi = np.tile(NULL, (2, 1))
    phi[1, index("solid_viscosity")] = eta
    given = {"table_friction": 1e-6, "viscosity": 1e-9, "yield_curvature": 1e3}
    physics = RodPhysics.nominal(scene, 2)._replace(**{name: jnp.full(2, size) for name, size in given.items()})
    tool = jnp.tile(jnp.asarray(PARKED_POSE), (2, round(seconds / scene.dt_s) + 1, 1))
    end = make_rod_rollout(scene, EFFECTS)(physics, start, tool, jnp.asarray(phi, jnp.float32))
    free, damped = np.asarray(end.nodes[:, 1], np.float64) @ shape
    rate = 2.16 * eta * scene.second_moment_m4 * (k / scene.length_m) ** 4 / (2 * scene.mass_kg / scene.length_m)
    assert damped / free == pytest.approx(np.exp(-rate * seconds), rel=0.1)
    assert damped / free < 0.8


def test_a_rope_that_relaxes_keeps_the_bend_that_it_was_held_in():
    """Held by friction for a second, then let go on ice: exp(-r t) of its bend springs back."""
    rate = 2.0
    phi = jnp.asarray(NULL[None], jnp.float32).at[0, index("relaxation_rate")].set(rate)
    tool = jnp.tile(jnp.asarray(PARKED_POSE), (1, 1001, 1))
    physics = RodPhysics.nominal(SCENE, 1)._replace(table_friction=jnp.full(1, 5.0))
    held = simulator()(physics, sprung(), tool, phi, known(1, 0.0))
    line = np.asarray(held.nodes[0, :2]).T
    assert curvature(line) == pytest.approx(2.5, rel=0.02)
    lasting = np.asarray(held.nodes[0, 7, 1:-1]).sum() / (SCENE.length_m - SCENE.rest_m)
    assert lasting == pytest.approx(2.5 * (1 - np.exp(-rate)), rel=0.02)


def test_a_softer_rope_yields_at_a_smaller_curvature():
    """With the softness c of its own yield curvature added, at half of that."""
    own = RodPhysics.nominal(SCENE, 1)
    moment = float(own.rigidity[0]) * 5.0
    softness = 4 / 3 * SCENE.radius_m**3 * np.sqrt(3 / 2) / moment
    ice = {"table_friction": 1e-4, "viscosity": 3e-6}
    lines = [run(sprung(), {"yield_softness": size}, 3.0, **ice) for size in (0.0, softness, 1.5 * softness)]
    assert abs(curvature(lines[0])) < 0.3
    assert curvature(lines[1]) == pytest.approx(0.0, abs=0.3)
    assert curvature(lines[2]) == pytest.approx(2.5 - 5.0 / 2.5, abs=0.25)


def test_the_documentation_says_which_effects_act_on_rods():
    said = " ".join((Path(__file__).parents[2] / "docs" / "effects.md").read_text().split())
    for start, act in (("These act on rods:", True), ("These do not", False)):
        names = ", ".join(f"`{name}`" for name, effect in discover().items() if (effect.rod is not None) == act)
        assert re.search(rf"{start}[^`]*{re.escape(names)}\.", said), f"Put this into docs/effects.md: {names}."


def test_effects_that_do_not_act_on_rods_are_refused_by_their_parameters():
    others = tuple(effect for effect in discover().values() if effect.rod is None)
    assert others
    with pytest.raises(ParameterError, match=r"Rods do not know .*cohesion"):
        make_rod_rollout(SCENE, others)
