"""Conformance of effects on rods, found in the catalogue by itself: null, gradient, bounds, and the particles' physics."""

from functools import cache
from itertools import accumulate

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.catalogue import discover
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodSetting
from app.sim.rods.rollout import RodPhysics, SimulateRod, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState

CATALOGUE = {name: effect for name, effect in discover().items() if effect.rod is not None}
"""The effects that act on rods."""
EFFECTS = tuple(CATALOGUE.values())
SPECS = [spec for effect in EFFECTS for spec in effect.parameters]
FIRST = dict(zip(CATALOGUE, accumulate((len(effect.parameters) for effect in EFFECTS), initial=0), strict=False))
LOW, NULL, HIGH = (np.array([getattr(spec, end) for spec in SPECS]) for end in ("low", "nominal", "high"))
SPAN = HIGH - LOW
SCENE = RodScene(length_m=0.40, radius_m=0.008, mass_kg=0.064, finger_radius_m=0.009)
MIDDLE = np.array([0.55, 0.0])
"""Of the workspace: where ropes are."""
PUSHES, STEPS = 16, 300
every_effect = pytest.mark.parametrize("name", CATALOGUE)


def columns(name: str) -> range:
    """Of an effect's parameters."""
    return range(FIRST[name], FIRST[name] + len(CATALOGUE[name].parameters))


def switches(name: str) -> list[int]:
    """The columns that make an effect vanish."""
    effect = CATALOGUE[name]
    return list(columns(name))[: effect.switches]


@cache
def simulator(*, acts: bool = True) -> SimulateRod:
    """With all effects in one module, or with none."""
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
    """Curved ropes that slide and turn, and a finger that pushes each of them for a while and stops."""
    rng = np.random.default_rng(4)
    lines = np.stack([arc(rng.uniform(-3, 3)) + MIDDLE + rng.uniform(-0.02, 0.02, 2) for _ in range(PUSHES)])
    state = lying(lines, rng.uniform(-0.15, 0.15, (PUSHES, 2)))
    state = state._replace(nodes=state.nodes.at[:, 7].multiply(0.6))
    ways = np.stack([[np.cos(a), np.sin(a)] for a in rng.uniform(0, 2 * np.pi, PUSHES)])
    met = lines[np.arange(PUSHES), rng.integers(4, SCENE.nodes - 4, PUSHES)]
    along = 0.25 * SCENE.dt_s * np.minimum(np.arange(STEPS + 1), STEPS * 3 // 4) - 0.022
    path = met[:, None] + along[:, None] * ways[:, None]
    tool = np.concatenate([path, np.full((PUSHES, STEPS + 1, 1), 0.006)], axis=2)
    physics = RodPhysics.nominal(SCENE, PUSHES)._replace(creep=jnp.full(PUSHES, 1e-3))
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
    """Random, (2, B, 2, n): what is differentiated is a sum in which nothing cancels."""
    return jnp.asarray(np.random.default_rng(5).normal(0.5, 1.0, (2, PUSHES, 2, SCENE.nodes)), jnp.float32)


def value(end: RodState) -> jax.Array:
    """A weighted sum of positions [mm] and velocities [dm/s] of each push."""
    w, u = weights()
    copies = len(end.nodes) // PUSHES
    many = (copies, PUSHES, 2, SCENE.nodes)
    x, v = end.nodes[:, :2].reshape(many), end.nodes[:, 2:4].reshape(many)
    x = x - pushes()[1].nodes[:, :2]
    return (1e3 * (w * x).mean((2, 3)) + 1e1 * (u * v).mean((2, 3))).reshape(-1)


def ends(phi: np.ndarray) -> RodState:
    """Of all pushes for each row of phi, one row after the other."""
    physics, state, tool, setting = jax.tree.map(lambda part: jnp.tile(part, (len(phi),) + (1,) * (part.ndim - 1)), pushes())
    return simulator()(physics, state, tool, jnp.asarray(np.repeat(phi, PUSHES, axis=0), jnp.float32), setting)


@cache
def gradient(point: str) -> np.ndarray:
    """Of each push (B, P), by one backward pass."""
    physics, state, tool, setting = pushes()

    def total(phi: jax.Array) -> jax.Array:
        return value(simulator()(physics, state, tool, phi, setting)).sum()

    phi = jnp.tile(jnp.asarray(POINTS[point], jnp.float32), (PUSHES, 1))
    return np.asarray(jax.grad(total)(phi), np.float64)


STEPS_OF_SPAN = (1e-3, 4e-3, 1.5e-2)
CENTRAL, ONE_SIDED = np.array([1 / 12, -2 / 3, 2 / 3, -1 / 12]), np.array([-7 / 4, 8 / 3, -1, 1 / 12])
"""Shares of the values at -2, -1, 1 and 2, or at 0, 1, 2 and 4 steps, in a slope of fourth order (Fornberg 1988)."""


@cache
def differences(point: str) -> np.ndarray:
    """The same (3, B, P) with three sizes of steps; one-sided where the range ends."""
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
    """In nearly all pushes and for one of the steps: a few pushes are at a kink, and small steps drown in rounding."""
    for column in columns(name):
        slope = gradient(point)[:, column] * SPAN[column]
        expected = differences(point)[..., column] * SPAN[column]
        assert np.isfinite(slope).all()
        floor = 1e-2 * np.abs(expected).max(1, keepdims=True) + 2e-3
        off = np.abs(slope - expected) - np.maximum(0.05 * np.abs(expected), floor)
        assert (off.min(0) <= 0).mean() >= 0.85, (SPECS[column].name, slope, expected)


@every_effect
def test_one_of_its_switches_has_a_response(name: str):
    """At the null, or where its physics is one-sided there, at a typical size."""
    found = max(np.abs(differences(point)[-1] * SPAN)[:, switches(name)].max() for point in POINTS)
    assert found > 0.02


@every_effect
def test_it_stays_finite_up_to_the_ends_of_its_ranges(name: str):
    for end in (LOW, HIGH):
        speeds = np.abs(np.asarray(at_the_ends(end is HIGH)))
        assert np.isfinite(speeds[list(columns(name))]).all()
        assert speeds[list(columns(name))].max() < 1.5


@cache
def at_the_ends(upper: bool) -> np.ndarray:
    """The fastest node's speed (P,) [m/s] with one parameter at its lower or upper end."""
    end = HIGH if upper else LOW
    nodes = np.asarray(ends(NULL + np.diag(end - NULL)).nodes)
    return np.abs(nodes[:, 2:4]).max((1, 2)).reshape(-1, PUSHES).max(1)
