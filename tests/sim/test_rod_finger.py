"""Laws of a rope that a flat finger pushes: seen from above, a line of some width with round edges."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError
from app.sim.rods.rollout import RodPhysics, SimulateRod, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState, bends
from tests.sim import pushed_ropes
from tests.sim.pushed_ropes import REACH_M, Change, assert_agree, central, crossing, curve, line_of, lying, straight
from tests.sim.pushed_ropes import SCENE as ROUND

SCENE = replace(ROUND, finger_half_width_m=0.015)
PUSHES = 32


@cache
def simulator(scene: RodScene = SCENE) -> SimulateRod:
    return make_rod_rollout(scene)


def physics(candidates: int = 1, **values: float) -> RodPhysics:
    nominal = RodPhysics.nominal(SCENE, candidates)
    return nominal._replace(**{name: jnp.full(candidates, value) for name, value in values.items()})


def gap_m(line: np.ndarray, middle: np.ndarray, yaw: float, half_width_m: float) -> float:
    """Least distance [m] between a centreline (n, 2) and a finger's core."""
    ends = np.stack([line[:-1], line[1:]])
    points = (ends[0] + np.linspace(0, 1, 21)[:, None, None] * (ends[1] - ends[0])).reshape(-1, 2)
    core = middle + np.linspace(-half_width_m, half_width_m, 101)[:, None] * [np.cos(yaw), np.sin(yaw)]
    return float(np.linalg.norm(points[:, None] - core, axis=-1).min())


def test_a_straight_rope_stays_straighter_before_a_flat_finger_than_before_a_round_one():
    """Over the flat finger's width it is as straight as that."""
    path = straight((0.0, -0.03), (0.0, 0.1), 0.8)
    flat = line_of(simulator()(physics(finger_half_width=0.02), lying(curve(0.0)), path))
    round_ = line_of(simulator(ROUND)(physics(), lying(curve(0.0)), path))
    middle = SCENE.nodes // 2
    before = slice(middle - 2, middle + 3)
    assert flat[middle, 1] == pytest.approx(0.05 + REACH_M, abs=1.5e-3)
    assert np.ptp(flat[before, 1]) < 5e-4
    assert np.ptp(round_[before, 1]) > 4e-3
    sharpest = [np.abs(np.asarray(bends(jnp.asarray(line.T[None])))).max() for line in (flat, round_)]
    assert sharpest[0] < 0.8 * sharpest[1]


@pytest.mark.parametrize("degrees", [0, 45, 90, 170])
@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_finger_and_rope_do_not_pass_through_each_other(speed: float, degrees: int):
    yaw = np.radians(degrees)
    for seconds in np.linspace(0.1, 0.1 / speed, 4):
        path = straight((0.02, -0.06), (0.0, speed), float(seconds))
        line = line_of(simulator()(physics(finger_yaw=yaw), lying(curve(0.6)), path))
        assert gap_m(line, np.asarray(path[0, -1, :2]), yaw, SCENE.finger_half_width_m) > REACH_M - 2e-3


def test_a_mirror_image_moves_like_a_mirror_image_and_either_end_of_rope_and_finger_may_be_the_first():
    start, path = curve(1.5), straight((0.06, -0.09), (0.02, 0.12), 0.9)
    end = line_of(simulator()(physics(finger_yaw=0.4), lying(start), path))
    mirrored = path * jnp.array([-1.0, 1.0, 1.0])
    mirror = line_of(simulator()(physics(finger_yaw=-0.4), lying(start * [-1, 1]), mirrored))
    turned = line_of(simulator()(physics(finger_yaw=0.4), lying(start[::-1]), path))
    half_turned = line_of(simulator()(physics(finger_yaw=0.4 + np.pi), lying(start), path))
    assert np.linalg.norm(end - start, axis=1).max() > 0.03
    assert mirror * [-1, 1] == pytest.approx(end, abs=5e-5)
    assert turned[::-1] == pytest.approx(end, abs=5e-5)
    assert half_turned == pytest.approx(end, abs=5e-5)


def test_a_finger_without_width_is_a_round_one_at_any_yaw():
    _, state, tool = pushes()
    given = RodPhysics.nominal(ROUND, PUSHES)
    round_ = simulator(ROUND)(given, state, tool).nodes
    scene = replace(ROUND, finger_half_width_m=0.0, finger_yaw_rad=0.7)
    assert np.array_equal(simulator(scene)(RodPhysics.nominal(scene, PUSHES), state, tool).nodes, round_)
    narrow = simulator()(given._replace(finger_yaw=jnp.full(PUSHES, 0.7)), state, tool).nodes
    assert np.asarray(narrow[:, :2]) == pytest.approx(np.asarray(round_[:, :2]), abs=2e-5)


# Gradients.


@cache
def pushes() -> tuple[RodPhysics, RodState, jax.Array]:
    """Ropes and fingers of any width and yaw that begin beside them and go on through them, at random."""
    rng = np.random.default_rng(5)
    lines = [curve(rng.uniform(-3, 3)) for _ in range(PUSHES)]
    half_width, yaw = rng.uniform(0.005, 0.02, PUSHES), rng.uniform(-np.pi, np.pi, PUSHES)
    paths = []
    for line, half_m, turned in zip(lines, half_width, yaw, strict=True):
        where, way = crossing(rng, line)
        starts = (where - behind * way for behind in np.arange(0.03, 0.3, 0.003))
        start = next(place for place in starts if gap_m(line, place, turned, half_m) > REACH_M + 0.002)
        paths.append(straight(start, 0.12 * way, 0.9)[0])
    given = physics(PUSHES, creep=1e-3, climb=0.2)._replace(
        finger_half_width=jnp.asarray(half_width, jnp.float32), finger_yaw=jnp.asarray(yaw, jnp.float32)
    )
    return given, lying(*lines), jnp.stack(paths)


def cost(given: RodPhysics, state: RodState, tool: jax.Array) -> jax.Array:
    """Cost (B,) of squared distances [cm^2] from each rope's first place, shifted."""
    return pushed_ropes.cost(simulator(), given, state, tool, pushes()[1])


@cache
def slopes() -> tuple[RodPhysics, RodState, jax.Array]:
    def total(given: RodPhysics, state: RodState, tool: jax.Array) -> jax.Array:
        return cost(given, state, tool).sum()

    return jax.grad(total, argnums=(0, 1, 2))(*pushes())


@pytest.mark.parametrize(
    "name", ["rigidity", "table_friction", "finger_friction", "mass", "climb", "finger_half_width", "finger_yaw"]
)
def test_gradients_of_parameters_equal_central_differences(name: str):
    given, state, tool = pushes()
    value = getattr(given, name)
    unit = jnp.ones(PUSHES) if name == "finger_yaw" else value

    def change(amount: float):
        return given._replace(**{name: value + unit * amount}), state, tool

    assert_differences(getattr(slopes()[0], name) * unit, change, 1e-3)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("part", ["path", "turn", "start"])
def test_gradients_of_action_and_state_equal_central_differences(part: str, axis: int):
    given, state, tool = pushes()
    ramp = jnp.linspace(0, 1, tool.shape[1]) if part == "turn" else jnp.ones(tool.shape[1])

    def change(amount: float):
        if part == "start":
            return given, state._replace(nodes=state.nodes.at[:, axis].add(amount)), tool
        return given, state, tool.at[:, :, axis].add(amount * ramp)

    bars = slopes()
    slope = bars[1].nodes[:, axis].sum(1) if part == "start" else (bars[2][:, :, axis] * ramp).sum(1)
    assert_differences(slope, change, 3e-5)


def assert_differences(slope: jax.Array, change: Change, step: float) -> None:
    """Check slopes against differences with two sizes of steps."""
    assert_agree(np.asarray(slope, np.float64), [central(cost, change, size) for size in (step, 4 * step)])


@pytest.mark.parametrize(
    ("field", "value"), [("finger_half_width_m", -0.001), ("finger_half_width_m", 0.06), ("finger_yaw_rad", np.nan)]
)
def test_a_finger_that_cannot_be_is_refused_by_name(field: str, value: float):
    with pytest.raises(ParameterError, match=field):
        replace(SCENE, **{field: value})
