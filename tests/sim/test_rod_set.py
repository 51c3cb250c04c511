"""Laws of the share of its bends that a rope keeps without load, and of the friction that holds the rest."""

from collections.abc import Callable
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError
from app.jobs import jit_cache
from app.jobs.worker_api import nominal_model
from app.sim.rods.rollout import RodPhysics, SimulateRod, make_rod_rollout
from app.sim.rods.state import RodState, bends
from tests.sim import pushed_ropes
from tests.sim.pushed_ropes import SCENE, assert_agree, central, crossing, headed, lying, straight

SHARES = (0.0, 0.5, 1.0)
PUSHES = 24


@cache
def simulator() -> SimulateRod:
    return jax.jit(make_rod_rollout(SCENE))


def curved(curvature: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Nodes (n, 2) of a line whose curvature [1/m] at s in 0..1 along it is given, about the origin."""
    s = np.arange(1, SCENE.nodes - 1) / (SCENE.nodes - 1)
    heading = np.concatenate([[0.0], np.cumsum(curvature(s) * SCENE.rest_m)])
    return headed(heading)


def arc(curvature: float) -> np.ndarray:
    return curved(lambda s: np.full(len(s), curvature))


def wave(curvature: float) -> np.ndarray:
    """Nodes of a line bent most in its middle, and straight at its ends, where no moment acts."""
    return curved(lambda s: curvature * np.sin(np.pi * s) ** 2)


def physics(shares: tuple[float, ...], **values: float) -> RodPhysics:
    """Physics of one candidate per share."""
    given = {name: jnp.full(len(shares), value) for name, value in values.items()}
    return RodPhysics.nominal(SCENE, len(shares))._replace(permanent_set=jnp.asarray(shares), **given)


def still(count: int, seconds: float) -> jax.Array:
    """A finger (B, T, 3) that stays up."""
    return jnp.tile(jnp.asarray([0.0, 0.0, 0.3]), (count, round(seconds / SCENE.dt_s) + 1, 1))


# At rest.


@pytest.mark.parametrize("curvature", [3.0, 20.0])
def test_a_rope_whose_stress_friction_bears_stays_where_it_is_seen(curvature: float):
    start = lying(*[wave(curvature)] * len(SHARES))
    end = simulator()(physics(SHARES), start, still(len(SHARES), 1.0))
    assert np.abs(np.asarray(end.nodes[:, :2] - start.nodes[:, :2])).max() < 1e-4
    assert np.abs(end.nodes[:, 2:4]).max() < 1e-4


def test_it_does_not_spring_as_it_would_if_friction_had_to_begin():
    start = lying(wave(20.0))
    begun = start._replace(nodes=start.nodes.at[:, 4, 0].set(1e-9))  # As if it had been simulated.
    held, sprung = (
        float(np.abs(simulator()(physics((0.0,)), each, still(1, 0.01)).nodes[:, 2:4]).max()) for each in (start, begun)
    )
    assert sprung > 1e-3
    assert held < 0.05 * sprung


def test_one_whose_stress_is_beyond_friction_comes_to_rest_with_less_bend():
    """On a table a tenth as rough the elastic rope unbends until friction holds the rest; the others stay."""
    start = lying(*[wave(20.0)] * len(SHARES))
    end = simulator()(physics(SHARES, table_friction=0.05), start, still(len(SHARES), 2.0))
    bent = np.asarray(bends(end.nodes[:, :2])).max(1) / np.asarray(bends(start.nodes[:, :2])).max(1)
    moved = np.abs(np.asarray(end.nodes[:, :2] - start.nodes[:, :2])).max((1, 2))
    assert 0.3 < bent[0] < 0.9
    assert moved[0] > 0.02
    assert np.abs(end.nodes[0, 2:4]).max() < 1e-3
    assert moved[1:].max() < 1e-3


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_without_load_a_rope_keeps_its_share_of_the_bend_that_it_was_seen_with(share: float):
    slippery = physics((share,), table_friction=1e-3, viscosity=3e-6)
    end = simulator()(slippery, lying(arc(2.5)), still(1, 3.0))
    kept = np.asarray(bends(end.nodes[:, :2])).mean() / SCENE.rest_m
    assert kept == pytest.approx(share * 2.5, abs=0.2 * 2.5)


@pytest.mark.parametrize("share", [0.75, 1.0])
def test_of_what_it_is_bent_beyond_its_yield_curvature_a_rope_keeps_its_share(share: float):
    """1 / m of 2.5 / m are elastic in any case. With smaller shares it swings back so far that it yields once more."""
    bent = lying(arc(2.5))
    bent = bent._replace(nodes=bent.nodes.at[:, 7].set(0.0))
    slippery = physics((share,), table_friction=1e-3, viscosity=3e-6, yield_curvature=1.0)
    end = simulator()(slippery, bent, still(1, 3.0))
    assert np.asarray(bends(end.nodes[:, :2])).mean() / SCENE.rest_m == pytest.approx(share * 1.5, rel=0.15)


# Pushed.


@cache
def pushes() -> tuple[RodPhysics, RodState, jax.Array]:
    """Ropes of different shares and fingers that go through them, at random."""
    rng = np.random.default_rng(3)
    lines = [wave(rng.uniform(-9, 9)) for _ in range(PUSHES)]
    paths = []
    for line in lines:
        where, way = crossing(rng, line)
        paths.append(straight(where - 0.03 * way, 0.12 * way, 0.9)[0])
    given = RodPhysics.nominal(SCENE, PUSHES)._replace(creep=jnp.full(PUSHES, 1e-3))
    shares = jnp.asarray(rng.uniform(0.1, 0.9, PUSHES), jnp.float32)
    return given._replace(permanent_set=shares), lying(*lines), jnp.stack(paths)


def cost(given: RodPhysics, state: RodState, tool: jax.Array) -> jax.Array:
    """Cost (B,) of squared distances [cm^2] from each rope's start, shifted."""
    return pushed_ropes.cost(simulator(), given, state, tool, state)


@cache
def slopes() -> RodPhysics:
    def total(given: RodPhysics) -> jax.Array:
        return cost(given, *pushes()[1:]).sum()

    return jax.jit(jax.grad(total))(pushes()[0])


@pytest.mark.parametrize("name", ["permanent_set", "rigidity", "table_friction", "yield_curvature"])
def test_gradients_equal_central_differences(name: str):
    given, state, tool = pushes()
    value = getattr(given, name)

    def change(amount: float):
        return given._replace(**{name: value * (1 + amount)}), state, tool

    slope = np.asarray(getattr(slopes(), name) * value, np.float64)
    assert_agree(slope, [central(cost, change, step) for step in (1e-3, 4e-3)])
    assert np.abs(slope).max() > 1e-3


def test_the_gradient_is_there_where_all_bends_last_and_where_none_does():
    given, state, tool = pushes()
    for share in (1.0, 0.0):
        ends = given._replace(permanent_set=jnp.full(PUSHES, share))
        slope = jax.jit(jax.grad(lambda each: cost(each, state, tool).sum()))(ends).permanent_set
        assert np.isfinite(slope).all()
        assert np.abs(slope).max() > 1e-3


def test_an_action_in_two_pieces_is_the_whole_action():
    given, state, tool = pushes()
    half = tool.shape[1] // 2
    whole = simulator()(given, state, tool)
    parts = simulator()(given, simulator()(given, state, tool[:, : half + 1]), tool[:, half:])
    assert np.asarray(parts.nodes) == pytest.approx(np.asarray(whole.nodes), abs=1e-6)


def test_a_second_action_goes_on_from_the_friction_and_the_bends_of_the_first():
    """A rope that came to rest without the finger stays there, though friction holds what would spring back."""
    given, state, tool = pushes()
    given = given._replace(creep=jnp.full(PUSHES, 1e-4))
    first = simulator()(given, simulator()(given, state, tool), still(PUSHES, 0.9)).resting()
    second = simulator()(given, first, still(PUSHES, 0.9))
    pushed, moved = (
        np.abs(np.asarray(after.nodes[:, :2] - before.nodes[:, :2])).max((1, 2))
        for after, before in ((first, state), (second, first))
    )
    assert np.median(pushed) > 0.02
    assert np.median(moved) < 2e-4


def test_a_mirror_image_moves_like_a_mirror_image_and_either_end_may_be_the_first():
    given, start, way = physics((0.4,)), wave(6.0), np.array([0.02, 0.12])
    path = straight(start[26] - 0.3 * way, way, 0.9)[0]
    mirror = jnp.array([-1.0, 1.0, 1.0])
    ends = [
        np.asarray(simulator()(given, lying(line), each[None]).nodes[0, :2]).T
        for line, each in ((start, path), (start * [-1, 1], path * mirror), (start[::-1], path))
    ]
    assert np.linalg.norm(ends[0] - start, axis=1).max() > 0.03
    assert ends[1] * [-1, 1] == pytest.approx(ends[0], abs=5e-5)
    assert ends[2][::-1] == pytest.approx(ends[0], abs=5e-5)


# In a model.


def test_material_points_refuse_a_model_that_says_it():
    phi = jit_cache.phi_of(nominal_model("rope_push@rods"))
    phi[jit_cache.index("permanent_set")] = 0.5
    with pytest.raises(ParameterError, match="do not know permanent_set"):
        jit_cache.search("rope_push", "cpu", phi)
