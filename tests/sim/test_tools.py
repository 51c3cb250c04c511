"""Laws of what touches objects: shapes, contact, and what a tool does to each material."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import warp as wp

from app.sim.constants import Shape
from app.sim.materials.cloth import ClothMaterial
from app.sim.materials.elastic import Elastic
from app.sim.materials.granular import Granular
from app.sim.materials.liquid import LiquidMaterial
from app.sim.materials.plastic import Plastic
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from app.sim.tools.base import Primitive, Tool
from app.sim.tools.bowl import BowlCollider
from app.sim.tools.box import BoxCollider, GripperCollider, Tray, WallsWithGap
from app.sim.tools.finger import FingerCollider
from app.sim.tools.flat_finger import FlatFinger
from app.sim.tools.rod import RackCollider, RodCollider
from tests.sim.test_materials import at_rest, lattice, positions, run

# Shapes.

SHAPES = {
    "box": BoxCollider(half_m=(0.03, 0.02, 0.01)).primitives()[0],
    "rod": RodCollider(half_length_m=0.04, radius_m=0.01).primitives()[0],
    "bowl": BowlCollider(radius_m=0.05, thickness_m=0.008).primitives()[0],
    "deep bowl": BowlCollider(radius_m=0.05, thickness_m=0.004, rim_m=0.02).primitives()[0],
    "shallow bowl": BowlCollider(radius_m=0.05, thickness_m=0.004, rim_m=-0.02).primitives()[0],
    "finger": FingerCollider(radius_m=0.01).primitives()[0],
    "flat finger": FlatFinger(radius_m=0.006, half_width_m=0.02).primitives()[0],
}


def evaluated(primitive: Primitive, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals (N, 3) and signed distances (N,) at points (N, 3) of the primitive's frame."""
    surface = primitive.surface

    @wp.kernel(module="unique")
    def kernel(s: Shape, p: wp.array[wp.vec3], n: wp.array[wp.vec3], gap: wp.array[float]):
        i = wp.tid()
        normal, distance, _cover = surface(s, p[i])
        n[i] = normal
        gap[i] = distance

    s = Shape()
    s.size = wp.vec4(*primitive.size)
    at = wp.array(points.astype(np.float32), dtype=wp.vec3, device="cpu")
    n, gap = wp.zeros_like(at), wp.zeros(len(points), dtype=float, device="cpu")
    wp.launch(kernel, len(points), [s, at, n, gap], device="cpu")
    return n.numpy().astype(np.float64), gap.numpy().astype(np.float64)


def surface_points(name: str) -> np.ndarray:
    """Many points (N, 3) of the surface, from the geometry and not from the signed distance."""
    rng = np.random.default_rng(1)
    size = SHAPES[name].size
    u = rng.normal(size=(60_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    if name == "rod":
        half, radius = size[:2]
        return radius * u + np.array([0, 1, 0]) * rng.uniform(-half, half, (len(u), 1)) * (rng.random((len(u), 1)) < 2)
    if name == "box":
        half, radius = np.array(size[:3]), size[3]
        core = rng.uniform(-1, 1, (len(u), 3)) * (half - radius)
        face = rng.integers(3, size=len(u))
        axis = np.eye(3)[face] * np.where(rng.random(len(u)) < 0.5, -1, 1)[:, None]
        flat = core * (1 - np.abs(axis)) + axis * half
        corner = np.sign(u) * (half - radius) + radius * u
        edge = corner.copy()
        along = np.eye(3)[face].astype(bool)
        round_edge = np.where(along, 0.0, u)
        round_edge /= np.linalg.norm(round_edge, axis=1, keepdims=True)
        edge = np.where(along, core, np.sign(u) * (half - radius) + radius * round_edge)
        return np.concatenate([flat, corner, edge])
    middle, thick, rim, level = size
    below = u[u[:, 2] * middle < rim] * 1.0
    angle = rng.uniform(0, 2 * np.pi, 20_000)
    centre = np.stack([level * np.cos(angle), level * np.sin(angle), np.full(len(angle), rim)], axis=1)
    tube = rng.normal(size=centre.shape)
    tube /= np.linalg.norm(tube, axis=1, keepdims=True)
    return np.concatenate([below * (middle - thick), below * (middle + thick), centre + thick * tube])


def scattered(count: int = 400) -> np.ndarray:
    """Points (N, 3) inside and outside."""
    return np.random.default_rng(2).uniform(-0.07, 0.07, (count, 3))


@pytest.mark.parametrize("name", SHAPES)
def test_a_normal_is_the_unit_gradient_of_the_signed_distance(name: str):
    points, step = scattered(), 2e-4
    n, _ = evaluated(SHAPES[name], points)
    gaps = [
        [evaluated(SHAPES[name], points + sign * step * np.eye(3)[axis])[1] for sign in (1, -1)] for axis in range(3)
    ]
    gradient = np.stack([(after - before) / (2 * step) for after, before in gaps], axis=1)
    smooth = np.abs(np.linalg.norm(gradient, axis=1) - 1) < 1e-2  # Not on a ridge, where two sides are equally near.
    assert smooth.mean() > 0.97
    assert np.linalg.norm(n, axis=1) == pytest.approx(np.ones(len(n)), abs=1e-3)
    assert np.abs(n - gradient)[smooth].max() < 0.03


@pytest.mark.parametrize("name", ["box", "rod", "bowl", "deep bowl", "shallow bowl"])
def test_a_signed_distance_is_that_to_the_nearest_point_of_the_surface(name: str):
    points = scattered()
    _, gap = evaluated(SHAPES[name], points)
    surface = surface_points(name)
    nearest = np.array([np.linalg.norm(surface - point, axis=1).min() for point in points])
    outside = gap > 0
    assert outside.any()
    assert (~outside).any()
    assert np.abs(gap)[outside] == pytest.approx(nearest[outside], abs=1.5e-3)


def test_the_inside_of_a_wall_is_inside_and_of_a_bowl_is_not():
    _, gap = evaluated(SHAPES["bowl"], np.array([[0, 0, -0.054], [0, 0, 0], [0, 0, -0.045], [0, 0, -0.063]]))
    assert gap == pytest.approx([-0.004, 0.050, 0.005, 0.005], abs=1e-5)


# Contact.

STAGE = Scene(
    low=(-0.10, -0.10, -0.02),
    high=(0.10, 0.10, 0.22),
    cell_m=0.010,
    dt_s=5e-4,
    contact_margin_m=0.0025,
    bodies=(Body(volume_m3=0.03**3, density_kg_m3=800.0),),
)
BLOCK = lattice((-0.015, -0.015, 0.0), (0.015, 0.015, 0.03), 0.005)


def still(tool: Tool, steps: int) -> np.ndarray:
    """A path (T, A) of a tool that does not move from where it is."""
    pose = {"fixed": [], "slides": [0, 0, 0.05], "turns": [0, 0, 0.07, 1, 0, 0, 0], "opens": [0, 0, 0, 1, 0, 0, 0, 0]}
    return np.tile(np.array(pose[tool.motion], np.float32), (steps + 1, 1)).reshape(steps + 1, -1)


RESTS: dict[str, Tool] = {
    "rod": RodCollider(half_length_m=0.03, radius_m=0.01, place_m=(0.0, 0.0, 0.05), friction=1.0),
    "rack": RackCollider(count=3, spacing_m=0.02, half_length_m=0.03, radius_m=0.006, place_m=(0.0, 0.0, 0.05)),
    "box": BoxCollider(half_m=(0.03, 0.03, 0.003), place_m=(0.0, 0.0, 0.05)),
    "tray": Tray(half_m=(0.03, 0.03), rim_m=0.02, place_m=(0.0, 0.0, 0.05)),
    "bowl": BowlCollider(radius_m=0.04, thickness_m=0.004),
}


@pytest.mark.parametrize("name", RESTS)
def test_what_is_dropped_on_a_thing_comes_to_rest_outside_of_it(name: str):
    tool = RESTS[name]
    scene = replace(STAGE, tools=(tool,), damping_1_s=4.0)
    start = BLOCK + np.array([0, 0, 0.08 if name != "bowl" else 0.05])
    state = run(scene, at_rest(start), still(tool, 1600), stiffness=5e4)
    x = positions(state)
    assert np.abs(np.asarray(state.v)).mean() < 0.02
    assert x[:, 2].min() > 0.02
    origin = np.array([0, 0, 0.07 if tool.motion == "turns" else 0.0])
    for primitive in tool.primitives():
        _, gap = evaluated(primitive, x - origin - np.array(primitive.place))
        assert gap.min() > -1e-4


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_block_on_a_box_stops_after_v_squared_over_2_mu_g(friction: float):
    slab = BoxCollider(half_m=(0.20, 0.05, 0.01), place_m=(0.0, 0.0, 0.05), friction=friction)
    scene = replace(STAGE, low=(-0.10, -0.10, -0.02), high=(0.25, 0.10, 0.18), tools=(slab,), damping_1_s=0.0)
    settled = run(scene, at_rest(BLOCK + np.array([-0.03, 0, 0.0625])), 600, stiffness=1e5)
    speed = 0.4
    moving = settled._replace(v=settled.v + jnp.array([speed, 0.0, 0.0]))
    end = run(scene, moving, 1000, stiffness=1e5)
    slid = (positions(end) - positions(settled)).mean(0)
    assert slid[0] == pytest.approx(speed**2 / (2 * friction * 9.81), rel=0.10)
    assert np.abs(np.asarray(end.v[0]).mean(0)).max() < 5e-3


def test_walls_stop_what_is_beside_their_gap_and_let_pass_what_fits():
    walls = WallsWithGap(place_m=(0.05, 0.0, 0.0), half_length_m=0.09, gap_m=0.05, height_m=0.05, friction=0.05)
    bodies = (Body(volume_m3=0.02**3, density_kg_m3=800.0),) * 2
    scene = replace(STAGE, low=(-0.10, -0.12, -0.02), high=(0.25, 0.12, 0.10), bodies=bodies, tools=(walls,))
    cube = lattice((-0.01, -0.01, 0.0), (0.01, 0.01, 0.02), 0.005)
    fits, stopped = cube, cube + np.array([0, 0.055, 0])
    state = at_rest(fits, stopped)
    state = state._replace(v=state.v + jnp.array([1.0, 0.0, 0.0]))
    x = positions(run(scene, state, 400, counts=(len(fits), len(stopped)), stiffness=5e4, friction=0.02))
    assert x[: len(fits), 0].min() > 0.055
    assert x[len(fits) :, 0].max() < 0.045


# Cloth in a gripper.

SIDE_M, CLOTH_SPACING_M = 0.10, 0.005
CLOTH_BODY = Body(volume_m3=SIDE_M**2 * 0.001, density_kg_m3=200.0, material=ClothMaterial(), stiffness=1.0)
HAND = GripperCollider(half_m=(0.010, 0.006, 0.020), friction=1.0)
GRIP = replace(
    STAGE, bodies=(CLOTH_BODY,), tools=(HAND,), contact_margin_m=0.002, dt_s=3e-4, damping_1_s=1.0, contact_width_m=1e-3
)


THREADS = np.float32([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
"""F of a sheet in the plane y = 0."""


def upright_cloth() -> State:
    """A sheet in the plane y = 0 that stands on the table."""
    x = lattice((-SIDE_M / 2, -0.001, 0.0), (SIDE_M / 2, 0.001, SIDE_M), CLOTH_SPACING_M)
    state = at_rest(x)
    return state._replace(F=jnp.broadcast_to(THREADS, state.F.shape))


def hand_path(*marks: tuple[float, float, float]) -> np.ndarray:
    """Poses (T, 8) through (time [s], height [m], opening [m])."""
    times, heights, openings = np.array(marks).T
    t = np.arange(0, times[-1], GRIP.dt_s)
    path = np.zeros((len(t), 8))
    path[:, 2], path[:, 3] = np.interp(t, times, heights), 1.0
    path[:, 7] = np.interp(t, times, openings)
    return path


def test_a_gripper_closes_on_cloth_lifts_it_opens_and_drops_it():
    grip = hand_path((0, 0.085, 0.008), (0.02, 0.085, 0.001), (0.05, 0.085, 0.001), (0.4, 0.145, 0.001))
    start = upright_cloth()
    lifted = run(GRIP, start, grip)
    before, held = positions(start), positions(lifted)
    between = (np.abs(before[:, 0]) < 0.008) & (before[:, 2] > 0.09)
    assert (held - before)[between, 2] == pytest.approx(np.full(between.sum(), 0.06), abs=0.015)
    assert held[:, 2].min() > 0.005
    opening = hand_path((0, 0.145, 0.001), (0.05, 0.145, 0.05), (0.4, 0.145, 0.05))
    dropped = positions(run(GRIP, lifted, opening))
    assert dropped[:, 2].mean() < 0.04


# Derivatives.

STEPS = 120
SHARP = {"phi": 1e-2, "x": 1e-4, "v": 3e-3, "tool": 1e-4}
"""Sizes of the central differences: small beside the widths of contact, large beside float32's rounding."""


def wave(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Random values that vary with component, and slowly from particle to particle."""
    return rng.normal(size=(1, *shape[1:])) * (1 + 0.5 * np.sin(np.linspace(0, 4, shape[0])))[:, None]


def turning_bowl(steps: int) -> np.ndarray:
    """Path of a bowl that shakes and tilts."""
    t = np.linspace(0, 1, steps + 1)
    path = np.zeros((steps + 1, 7))
    path[:, 0], path[:, 2], angle = 0.01 * t**2, 0.07 + 0.004 * t, 0.3 * t
    path[:, 3], path[:, 5] = np.cos(angle / 2), np.sin(angle / 2)
    return path


def closing_hand(steps: int, opening_m: float) -> np.ndarray:
    """Path of a gripper that closes by 8 mm."""
    t = np.linspace(0, 1, steps + 1)
    path = np.zeros((steps + 1, 8))
    path[:, 2], path[:, 3], path[:, 7] = 0.052, 1.0, opening_m - 0.008 * t
    return path


SMALL = {
    "elastic": Elastic(),
    "plastic": Plastic(yield_pa=200.0),
    "granular": Granular(),
    "liquid": LiquidMaterial(),
    "cloth": ClothMaterial(),
}


@cache
def problem(material: str, tool: str) -> tuple[Scene, np.ndarray, State, np.ndarray]:
    """A body of this material that moves in a bowl or between the fingers of a gripper."""
    rng = np.random.default_rng(4)
    lying = lattice((-0.016, -0.016, 0.034), (0.016, 0.016, 0.05), 0.0055)
    standing = lattice((-0.016, -0.016, 0.05), (0.016, 0.016, 0.08), 0.0055)
    sheet = lattice((-0.016, -0.001, 0.05), (0.016, 0.001, 0.08), 0.0055)
    x = sheet if material == "cloth" else lying if tool == "bowl" else standing
    tools = {
        "bowl": BowlCollider(radius_m=0.045, thickness_m=0.006),
        "gripper": GripperCollider(half_m=(0.02, 0.006, 0.02)),
    }
    body = Body(volume_m3=len(x) * 0.0055**3, density_kg_m3=1000.0, material=SMALL[material])
    scene = replace(STAGE, bodies=(body,), tools=(tools[tool],))
    shape = (len(x), 3)
    state = at_rest(x)
    state = state._replace(
        v=state.v + jnp.asarray(0.02 * wave(rng, shape), jnp.float32) - jnp.array([0.0, 0.0, 0.2]),
        F=state.F * jnp.float32(0.99),
    )
    if material == "cloth":
        state = state._replace(F=0.99 * jnp.broadcast_to(THREADS, state.F.shape))
    path = turning_bowl(STEPS) if tool == "bowl" else closing_hand(STEPS, 0.010 if material == "cloth" else 0.036)
    return scene, np.float32([[2e4, 0.4]]), state, path[None].astype(np.float32)


@cache
def gradient(material: str, tool: str) -> tuple[np.ndarray, State, np.ndarray]:
    """Gradient of the weighted sum of the last state, with respect to phi, state and tool."""
    scene, phi, state, path = problem(material, tool)
    simulate = make_rollout(scene, particle_count=state.x.shape[1], effects=())

    def value(phi: jax.Array, state: State, path: jax.Array) -> jax.Array:
        end = simulate(phi, state, path)
        weights = weights_of(state)
        return sum(jnp.sum(part * weight) for part, weight in zip((end.x, end.v), weights, strict=True))

    bars = jax.grad(value, argnums=(0, 1, 2))(jnp.asarray(phi), state, jnp.asarray(path))
    return jax.tree.map(np.asarray, bars)


def weights_of(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Weights of final positions and velocities, smooth in the particles' order."""
    rng = np.random.default_rng(7)
    shape = state.x.shape[1:]
    return np.float32(1e3 * wave(rng, shape)[None]), np.float32(wave(rng, shape)[None])


CASES = [("granular", "bowl"), ("liquid", "bowl"), ("plastic", "bowl"), ("cloth", "gripper"), ("elastic", "gripper")]


@pytest.mark.parametrize("part", SHARP)
@pytest.mark.parametrize(("material", "tool"), CASES)
def test_gradients_through_contact_equal_central_differences(material: str, tool: str, part: str):
    scene, phi, state, path = problem(material, tool)
    simulate = make_rollout(scene, particle_count=state.x.shape[1], effects=())
    phi_bar, state_bar, path_bar = gradient(material, tool)
    bar = {"phi": phi_bar, "x": state_bar.x, "v": state_bar.v, "tool": path_bar}[part]
    at = {"phi": phi, "x": np.asarray(state.x), "v": np.asarray(state.v), "tool": path}

    def end(step: np.ndarray) -> list[np.ndarray]:
        moved = at | {part: at[part] + step}
        moved = {name: jnp.asarray(value, jnp.float32) for name, value in moved.items()}
        out = simulate(moved["phi"], state._replace(x=moved["x"], v=moved["v"]), moved["tool"])
        return [np.asarray(out.x, np.float64), np.asarray(out.v, np.float64)]

    columns = {"phi": [0], "x": range(3), "v": range(3), "tool": range(path.shape[2])}[part]
    expected, given = [], []
    for column in columns:
        step = np.zeros(at[part].shape, np.float32)
        step[..., column] = SHARP[part] * (1 + np.abs(at[part][..., column]) if part == "phi" else 1.0)
        difference = sum(
            ((after - before) * weight).sum()
            for after, before, weight in zip(end(step), end(-step), weights_of(state), strict=True)
        )
        expected.append(difference / 2)
        given.append(float((bar * step).sum()))
    # Stiffness matters little here: float32's rounding of positions is 3 % of its differences, and yield has a kink.
    assert given == pytest.approx(expected, rel=0.10 if part == "phi" else 0.03, abs=0.03 * np.abs(expected).max())
