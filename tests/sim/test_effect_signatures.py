"""Signatures of the effects: each obeys a law of physics, or shows the sign by which an experimenter knows it."""

from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.materials.base import Material
from app.sim.materials.granular import Granular
from app.sim.materials.liquid import LiquidMaterial
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import Setting, State
from tests.sim.scenes import PARTICLES, SCENE, block, far_tool, floating, phi_with, rope, straight_tool

G = 9.81
SPEED = 0.4
FRICTION = 0.4
TABLE = replace(SCENE, damping_1_s=0.0)
CUBE = replace(TABLE, bodies=(Body(volume_m3=0.03**3, density_kg_m3=800.0),))
ROPE = rope()
ALONG = (ROPE[:, 0] - 0.51) / 0.04
LABELS = np.stack([ALONG, ROPE[:, 1], np.ones(PARTICLES), np.zeros(PARTICLES)], axis=1)


@cache
def simulator(scene: Scene, particles: int) -> Simulate:
    return make_rollout(scene, particle_count=particles)


def run(
    scene: Scene,
    start: State,
    tool: np.ndarray,
    *models: dict[str, float],
    label: np.ndarray | None = None,
    times: tuple[float, ...] = (),
) -> list[State]:
    """Ends of one candidate per model, or of one model at each of these times of a session."""
    count = max(len(models), len(times))
    phi = np.stack([phi_with(**model) for model in models] * (count // len(models)))
    setting = Setting.unknown(count, start.x.shape[1])
    if label is not None:
        setting = setting._replace(label=jnp.tile(jnp.asarray(label, jnp.float32), (count, 1, 1)))
    if times:
        setting = setting._replace(time=jnp.asarray(times))
    many = State(*(jnp.repeat(jnp.asarray(part, jnp.float32), count, axis=0) for part in start))
    tools = jnp.tile(jnp.asarray(tool), (count, 1, 1))
    end = simulator(scene, start.x.shape[1])(jnp.asarray(phi), many, tools, setting)
    return [State(*(np.asarray(part[row], np.float64) for part in end)) for row in range(count)]


@cache
def resting_cube(x_m: float = 0.46) -> State:
    """A cube of 3 cm that has settled on the table; (1, N, ...)."""
    start = State.at_rest(jnp.asarray(block(6, spacing_m=0.005, low=(x_m, -0.015, 0.0)))[None])
    (end,) = run(CUBE, start, far_tool(200), {"stiffness": 1e5, "table_friction": FRICTION})
    return State(*(part[None] for part in end))


def slides(
    velocity: tuple[float, float] = (SPEED, 0.0),
    *models: dict[str, float],
    x_m: float = 0.46,
    **more: tuple[float, ...],
) -> list[float]:
    """Distances [m] that the cube slides on the table, one per model."""
    rest = resting_cube(x_m)
    moving = rest._replace(v=rest.v + np.array([*velocity, 0.0]))
    stiff = [{"stiffness": 1e5, "table_friction": FRICTION} | model for model in models]
    ends = run(CUBE, moving, far_tool(500), *stiff, **more)
    assert all(np.abs(end.v.mean(0)).max() < 5e-3 for end in ends)
    return [float(np.linalg.norm((end.x - rest.x[0]).mean(0)[:2])) for end in ends]


SLIDE_M = SPEED**2 / (2 * FRICTION * G)


def still(x: np.ndarray) -> State:
    return State.at_rest(jnp.asarray(x)[None])


def flung(x: np.ndarray, v: np.ndarray, C: np.ndarray | None = None) -> State:
    """State at x with velocities v, and velocity gradients C."""
    start = still(x)._replace(v=jnp.asarray(v, jnp.float32)[None])
    return start if C is None else start._replace(C=jnp.tile(jnp.asarray(C, jnp.float32), (*start.x.shape[:2], 1, 1)))


# Environment and contact.


def test_on_a_tilted_table_a_rope_without_friction_drifts_downhill_by_g_sin_a_t_squared_over_2():
    steps, angle = 200, 4.0
    level, raised, lowered = run(
        TABLE,
        still(ROPE),
        far_tool(steps),
        *({"table_friction": 0.0} | tilt for tilt in ({}, {"tilt_x": angle}, {"tilt_y": angle})),
    )
    drop = G * np.sin(np.radians(angle)) * (steps * SCENE.dt_s) ** 2 / 2
    assert (raised.x - level.x).mean(0)[1] == pytest.approx(-drop, rel=0.02)
    assert (lowered.x - level.x).mean(0)[0] == pytest.approx(drop, rel=0.02)


def test_a_draught_carries_what_is_in_the_air_and_hardly_what_lies_on_the_table():
    scene, steps, share = replace(TABLE, high=(0.60, 0.10, 0.14)), 150, 0.2
    carried = []
    for height in (0.11, 0.008):
        calm, windy = run(scene, still(rope(height_m=height)), far_tool(steps), {}, {"draught_y": share})
        carried.append((windy.x - calm.x).mean(0)[1])
    assert carried[0] == pytest.approx(share * G * (steps * SCENE.dt_s) ** 2 / 2, rel=0.02)
    assert abs(carried[1]) < 0.1 * carried[0]


def test_the_same_slide_is_shorter_where_the_friction_map_is_higher():
    slope = 3.0
    here, there = (slides((0.0, SPEED), {"friction_slope_x": slope}, x_m=x)[0] for x in (0.45, 0.53))
    factor = [1 + slope * (x + 0.015 - 0.55) for x in (0.45, 0.53)]
    assert here / there == pytest.approx(factor[1] / factor[0], rel=0.03)


def test_with_anisotropic_friction_a_slide_depends_on_its_direction_but_not_on_its_sense():
    model = {"anisotropy_axes": 0.3}
    along, back, across = (slides(v, model)[0] for v in ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.3)))
    assert along == pytest.approx(back, rel=0.02)
    assert across / along == pytest.approx(1.3 / 0.7, rel=0.05)


def test_on_the_diagonal_it_is_the_other_coefficient_that_acts():
    model = {"anisotropy_diagonals": 0.3}
    more, less = (slides(v, model)[0] for v in ((0.2, 0.2), (0.2, -0.2)))
    assert less / more == pytest.approx(1.3 / 0.7, rel=0.05)


def test_with_stribeck_friction_a_slow_slide_is_shortened_and_a_fast_one_hardly():
    models = ({}, {"stribeck_excess": 0.5, "stribeck_speed": 0.1})
    (slow, shorter), (fast, same) = (slides((v, 0.0), *models) for v in (0.1, 0.45))
    assert shorter / slow < 0.80
    assert same / fast > 0.95


def test_what_rolls_runs_on_for_as_much_longer_as_it_rolls_easier():
    sliding, rolling = slides((0.2, 0.0), {}, {"rolling_share": 0.4})
    assert rolling / sliding == pytest.approx(1 / 0.4, rel=0.05)


def test_what_the_finger_pushes_does_not_roll():
    tool = straight_tool((0.51, -0.022, 0.005), (0.0, 0.3, 0.0), 100)
    sliding, rolling = run(TABLE, still(ROPE), tool, {}, {"rolling_share": 0.1})
    touched = np.abs(ALONG) < 0.15
    assert (rolling.x - sliding.x)[touched, 1].mean() < 0.001


def test_with_adhesion_a_rope_follows_the_retreating_finger():
    tool = straight_tool((0.51, -0.018, 0.005), (0.0, -0.05, 0.0), 200)
    free, sticky = run(SCENE, still(ROPE), tool, {"table_friction": 0.1}, {"table_friction": 0.1, "adhesion": 1000.0})
    assert (free.x - ROPE).mean(0)[1] > -2e-4
    assert (sticky.x - ROPE).mean(0)[1] < -0.0015


def test_finger_friction_carries_a_rope_along_with_a_finger_that_passes_it():
    tool = straight_tool((0.49, -0.020, 0.005), (0.3, 0.1, 0.0), 150)
    smooth, rough = run(SCENE, still(ROPE), tool, {"finger_friction": 0.05}, {"finger_friction": 1.0})
    assert (rough.x - smooth.x).mean(0)[0] > 0.001


def test_a_viscous_film_stops_a_slide_after_v_over_c():
    rate = 20.0
    (end,) = run(
        TABLE,
        flung(ROPE, np.full((PARTICLES, 3), [0.2, 0.0, 0.0])),
        far_tool(600),
        {"table_friction": 0.0, "film_drag": rate},
    )
    slid = (end.x - ROPE).mean(0)[0]
    assert 0.2 / rate < slid < 2.0 * 0.2 / rate  # The film acts less on the rope's upper half.


def test_a_point_constraint_holds_the_rope_where_it_is_and_lets_the_rest_go_on():
    pin = {"constraint_rate": 500.0, "constraint_x": 0.51, "table_friction": 0.0, "stiffness": 2e3}
    (end,) = run(TABLE, flung(ROPE, np.full((PARTICLES, 3), [0.0, 0.2, 0.0])), far_tool(100), pin)
    moved = (end.x - ROPE)[:, 1]
    assert moved[np.abs(ALONG) < 0.2].mean() < 0.003
    assert moved[np.abs(ALONG) > 0.8].mean() > 0.005


def test_a_point_attracts_from_all_sides():
    place = {"attraction": 0.3, "attraction_x": 0.51, "attraction_y": 0.05, "table_friction": 0.0}
    for side in (-1, 1):
        x = ROPE + np.float32([0.0, 0.05 + 0.03 * side, 0.0])
        (end,) = run(TABLE, still(x), far_tool(150), place)
        assert side * (end.x - x).mean(0)[1] < -0.003


def test_a_hidden_obstacle_stops_what_comes_and_lets_go_what_leaves():
    post = {"table_friction": 0.0, "obstacle_rate": 3000.0, "obstacle_x": 0.51, "obstacle_y": 0.03}
    (coming,) = run(TABLE, flung(ROPE, np.full((PARTICLES, 3), [0.0, 0.2, 0.0])), far_tool(200), post)
    middle = np.abs(ALONG) < 0.2
    assert (coming.x - ROPE)[middle, 1].mean() < 0.012
    (leaving,) = run(TABLE, flung(ROPE, np.full((PARTICLES, 3), [0.0, -0.2, 0.0])), far_tool(200), post)
    assert (leaving.x - ROPE)[middle, 1].mean() == pytest.approx(-0.02, rel=0.05)


# Material.


def stretching(rate: float) -> State:
    """A rope in the air that is being pulled out along x."""
    x = rope(height_m=0.03)
    v = np.stack([rate * 0.04 * ALONG, 0 * ALONG, 0 * ALONG], axis=1)
    return flung(x, v, np.diag([rate, 0.0, 0.0]))


def bending(rate: float) -> State:
    """A rope in the air whose ends are flung to +y."""
    x = rope(height_m=0.03)
    v = np.stack([0 * ALONG, rate * (ALONG**2 - 1 / 3), 0 * ALONG], axis=1)
    return flung(x, v)


def bend(end: State) -> float:
    """Distance [m] that a rope's ends have come towards +y against its middle."""
    y = end.x[:, 1] - ROPE[:, 1]
    return float(y[np.abs(ALONG) > 0.8].mean() - y[np.abs(ALONG) < 0.2].mean())


def test_a_rope_that_is_pulled_gives_most_at_its_soft_end():
    even, uneven = run(floating(), stretching(8.0), far_tool(14), {}, {"stiffness_slope": 1.0}, label=LABELS)
    stretch = [end.F[:, 0, 0] for end in (even, uneven)]
    soft, stiff = ALONG < -0.3, ALONG > 0.3
    assert stretch[0][soft].mean() == pytest.approx(stretch[0][stiff].mean(), abs=0.01)
    assert stretch[1][soft].mean() > stretch[1][stiff].mean() + 0.02


def test_without_labels_heterogeneity_does_nothing():
    model = {"stiffness_slope": 1.0, "stiffness_bow": 0.5, "mass_slope": 0.5, "mass_bow": 0.5, "rest_curvature": 10.0}
    even, uneven = run(floating(), stretching(8.0), far_tool(40), {}, model)
    assert even.x == pytest.approx(uneven.x, abs=1e-6)


def test_the_heavy_end_of_a_rope_that_contracts_moves_less():
    start = still(rope(height_m=0.03))
    stretched = start._replace(F=start.F.at[..., 0, 0].set(1.1))
    even, uneven = run(floating(), stretched, far_tool(40), {}, {"mass_slope": 0.7}, label=LABELS)
    inwards = [-np.sign(ALONG) * (end.x - np.asarray(start.x[0]))[:, 0] for end in (even, uneven)]
    light, heavy = ALONG < -0.5, ALONG > 0.5
    assert inwards[0][light].mean() == pytest.approx(inwards[0][heavy].mean(), rel=0.1)
    assert inwards[1][light].mean() > 1.2 * inwards[1][heavy].mean()


def test_a_rope_with_rest_curvature_curls_to_its_left():
    scene = replace(floating(), damping_1_s=30.0)
    models = [{"rest_curvature": curvature} for curvature in (-10.0, 0.0, 10.0)]
    right, straight, left = run(scene, still(rope(height_m=0.03)), far_tool(400), *models, label=LABELS)
    sag = 10.0 * (0.04 * np.sqrt((ALONG[np.abs(ALONG) > 0.8] ** 2).mean())) ** 2 / 2
    assert abs(bend(straight)) < 0.1 * sag
    assert bend(left) == pytest.approx(sag, rel=0.3)
    assert bend(right) == pytest.approx(-sag, rel=0.3)


def test_kelvin_voigt_damps_an_oscillation():
    start = stretching(8.0)
    free, damped = run(floating(), start, far_tool(60), {}, {"solid_viscosity": 20.0})
    frequency = np.pi * np.sqrt(2e4 / 800.0) / 0.08  # Of the lowest mode of a rod with free ends [rad/s].
    wave = np.sin(np.pi / 2 * ALONG)
    sizes = [
        np.hypot((wave * (end.x - np.asarray(start.x[0]))[:, 0]).mean(), (wave * end.v[:, 0]).mean() / frequency)
        for end in (free, damped)
    ]
    assert sizes[1] < 0.5 * sizes[0]


def test_kelvin_voigt_leaves_a_slide_alone():
    free, damped = slides((SPEED, 0.0), {}, {"solid_viscosity": 20.0})
    assert damped == pytest.approx(free, rel=0.02)


@pytest.mark.parametrize("model", [{"relaxation_rate": 50.0}, {"yield_softness": 0.003}], ids=["maxwell", "yield"])
def test_a_rope_that_flows_keeps_part_of_its_bend(model: dict[str, float]):
    scene = replace(floating(), damping_1_s=20.0)
    elastic, flowing = run(scene, bending(1.0), far_tool(600), {}, model)
    assert abs(bend(elastic)) < 0.3 * abs(bend(flowing))
    assert bend(flowing) > 0.001


def test_a_yield_stress_that_is_not_reached_changes_nothing():
    elastic, stiff = run(floating(), bending(0.05), far_tool(100), {}, {"yield_softness": 1e-4})
    assert elastic.x == pytest.approx(stiff.x, abs=1e-6)


def pile(material: Material, *, height: int = 1) -> tuple[Scene, np.ndarray]:
    x = block(5, spacing_m=0.006, low=(0.495, -0.015, 0.0))
    x = np.concatenate([x + np.float32([0.0, 0.0, 0.03 * level]) for level in range(height)])
    body = Body(volume_m3=len(x) * 0.006**3, density_kg_m3=1000.0, material=material)
    return replace(TABLE, bodies=(body,)), x


def test_moist_grains_keep_a_wall_that_dry_ones_do_not():
    scene, x = pile(Granular())
    dry, moist = run(scene, still(x), far_tool(400), {}, {"cohesion": 500.0})
    widths = [np.ptp(end.x[:, 0]) for end in (dry, moist)]
    assert widths[0] > 0.035
    assert widths[1] < 0.028


def test_a_thinning_liquid_resists_fast_shear_less_and_slow_shear_more():
    material = LiquidMaterial(viscosity_pa_s=5.0)
    scene, x = pile(material)
    scene = replace(scene, gravity_m_s2=0.0)
    x = x + np.float32([0.0, 0.0, 0.02])
    middle = x.mean(0)
    left = {}
    for rate in (1.0, 60.0):
        C = np.zeros((3, 3))
        C[0, 1] = rate
        start = flung(x, (x - middle) @ C.T, C)
        newtonian, thinning = run(scene, start, far_tool(20), {}, {"flow_index": 0.5})
        left[rate] = [float(np.abs(end.C[:, 0, 1]).mean()) / rate for end in (newtonian, thinning)]
    assert left[60.0][1] > left[60.0][0] + 0.02
    assert left[1.0][1] < left[1.0][0] - 0.02


# Time.


def test_with_drift_the_same_slide_grows_shorter_during_the_session():
    early, middle, late = slides((SPEED, 0.0), {"friction_drift": 0.6}, times=(-0.5, 0.0, 0.5))
    assert middle == pytest.approx(SLIDE_M, rel=0.05)
    assert early / late == pytest.approx(1.3 / 0.7, rel=0.05)


def test_an_abrupt_change_has_a_before_and_an_after():
    model = {"friction_step": 0.5, "step_time": 0.2}
    first, before, after, last = slides((SPEED, 0.0), model, times=(-0.5, 0.0, 0.4, 0.5))
    assert first == pytest.approx(before, rel=0.02)
    assert after == pytest.approx(last, rel=0.02)
    assert before / after == pytest.approx(np.exp(0.5), rel=0.05)


def test_after_an_abrupt_change_of_stiffness_a_rope_gives_more():
    model = {"stiffness_step": -1.0, "step_time": 0.0}
    before, after = run(floating(), stretching(8.0), far_tool(40), model, times=(-0.4, 0.4))
    assert after.F[:, 0, 0].mean() > before.F[:, 0, 0].mean() + 0.01


# What no cause of the catalogue is.


def drawn_off(x: np.ndarray, model: dict[str, float], velocity: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Shift (2,) [m] of a rope without friction on the table in 70 ms: with the model, less that without it."""
    start = flung(x, np.tile(velocity, (PARTICLES, 1)))
    free, moved = run(TABLE, start, far_tool(140), {"table_friction": 0.0}, {"table_friction": 0.0, **model})
    return (moved.x - free.x).mean(0)[:2]


FALL_M = G * 0.07**2 / 2
PARKED_POSE = np.float32([0.02, 0.03, 0.0])
"""Shift of a rope about (0.51, 0), which brings it to (-0.02, 0.03) m from the middle of the workspace."""


@pytest.mark.parametrize(
    ("model", "share"),
    [
        ({"push_x": 0.2}, (0.2, 0.0)),
        ({"spread": 4.0}, (-0.08, 0.12)),
        ({"swirl": 4.0}, (-0.12, -0.08)),
        ({"stretch_axes": 4.0}, (-0.08, -0.12)),
        ({"stretch_diagonals": 4.0}, (0.12, -0.08)),
    ],
    ids=["push", "spread", "swirl", "axes", "diagonals"],
)
def test_a_force_of_place_is_the_linear_field_that_it_says(model: dict[str, float], share: tuple[float, float]):
    assert drawn_off(ROPE + PARKED_POSE, model) == pytest.approx(np.array(share) * FALL_M, abs=0.05 * 0.15 * FALL_M)


def test_drag_by_the_square_of_speed_slows_a_fast_rope_more_than_a_slow_one():
    def lost(model: dict[str, float], speed: float) -> float:
        return -float(drawn_off(ROPE, model, (speed, 0.0, 0.0))[0]) / speed

    assert lost({"drag_squared": 20.0}, 0.4) == pytest.approx(2 * lost({"drag_squared": 20.0}, 0.2), rel=0.2)
    assert lost({"drag": 5.0}, 0.4) == pytest.approx(lost({"drag": 5.0}, 0.2), rel=0.02)


def test_what_is_pulled_sideways_goes_to_the_left_of_its_way_and_no_faster():
    pulls = [drawn_off(ROPE, {"sideways": 0.1}, velocity) for velocity in ((0.4, 0.0, 0.0), (-0.4, 0.0, 0.0))]
    assert pulls[0][1] == pytest.approx(0.1 * FALL_M, rel=0.1)
    assert pulls[1][1] == pytest.approx(-pulls[0][1], rel=0.05)
    turned = drawn_off(ROPE, {"sideways_rate": 20.0}, (0.4, 0.0, 0.0))
    start = flung(ROPE, np.full((PARTICLES, 3), [0.4, 0.0, 0.0]))
    ends = run(TABLE, start, far_tool(140), {"table_friction": 0.0}, {"table_friction": 0.0, "sideways_rate": 20.0})
    speeds = [np.linalg.norm(end.v.mean(0)[:2]) for end in ends]
    assert turned[1] > 0.005
    assert speeds[1] == pytest.approx(speeds[0], rel=0.02)


def test_a_push_that_grows_with_the_session_turns_round_in_its_middle():
    ends = run(TABLE, still(ROPE), far_tool(140), {"growth_y": 0.4, "table_friction": 0.0}, times=(-0.5, 0.0, 0.5))
    early, middle, late = (float((end.x - ROPE).mean(0)[1]) for end in ends)
    assert late == pytest.approx(0.2 * FALL_M, rel=0.05)
    assert early == pytest.approx(-late, rel=0.05)
    assert abs(middle) < 0.02 * late
