"""Each hidden effect does what it says, in the direction and by the amount that it says."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.rig.simulated.cameras.cameras import CameraNoise, table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.injected_effects.base import SensorImages
from app.rig.simulated.worlds.engine import mujoco
from app.rig.simulated.worlds.physics import RopePhysics, WorldPhysics
from app.rig.simulated.worlds.rope import add_rope, resample
from app.rig.simulated.worlds.rope_world import RopeWorld
from tests.rig.hidden.moments import effect, injected, moment, moving, track, world
from tests.rig.scene import FINGER, PUSH_Z, ROPE, straight_rope

ICE = WorldPhysics(table_friction=0.0)
NOISELESS = CameraNoise(depth_per_m=0.0, edge_dropout=0.0, grazing_dropout=0.0, colour_levels=0.0)


def friction(name: str, *values: float, **given: object) -> np.ndarray:
    hook = effect(name).friction
    assert hook is not None
    return hook(moment(**given), np.array(values))


def force(name: str, *values: float, **given: object) -> np.ndarray:
    hook = effect(name).force
    assert hook is not None
    return hook(moment(**given), np.array(values))


def driven(name: str, *values: float, yaw: float = 0.0) -> np.ndarray:
    """Positions at the times of the command."""
    hook = effect(name).drive
    assert hook is not None
    return hook(track(yaw), np.array(values)).at(track().times_s)


def test_on_a_tilted_table_without_friction_the_rope_slides_with_g_sin_a() -> None:
    table = world(injected("table_tilt", 0.0, 2.0), physics=ICE)
    before = table.nodes().mean(0)
    table.step(table.tool, 0.5)
    moved = table.nodes().mean(0) - before
    assert moved[0] == pytest.approx(9.81 * np.sin(np.radians(2.0)) * 0.5**2 / 2, rel=0.02)
    assert abs(moved[1]) < 1e-6


def test_a_tilt_that_raises_the_far_left_side_pulls_to_the_right() -> None:
    table = world(injected("table_tilt", 2.0, 0.0), physics=ICE)
    before = table.nodes().mean(0)
    table.step(table.tool, 0.3)
    assert table.nodes().mean(0)[1] < before[1] - 0.005


def test_a_tilt_that_friction_holds_moves_nothing() -> None:
    table = world(injected("table_tilt", 0.0, 4.0))
    before = table.nodes()
    table.step(table.tool, 2.0)
    assert np.abs(table.nodes()[:, :2] - before[:, :2]).max() < 1e-4


def test_a_draught_that_friction_holds_moves_nothing_and_lets_the_rope_sleep() -> None:
    table = world(injected("draught", 0.3, 0.0))
    before = table.nodes()
    table.step(table.tool, 2.0)
    assert np.abs(table.nodes()[:, :2] - before[:, :2]).max() < 1e-4


def test_a_draught_blows_a_rope_on_ice_with_its_share_of_weight() -> None:
    table = world(injected("draught", 0.0, 0.2), physics=ICE)
    before = table.nodes().mean(0)
    table.step(table.tool, 0.5)
    # The mean of (z / 2 cm)^2 over a disc of 8 mm that lies on the table.
    exposed = (0.008**2 + 0.008**2 / 4) / 0.02**2
    assert table.nodes().mean(0)[1] - before[1] == pytest.approx(0.2 * exposed * 9.81 * 0.5**2 / 2, rel=0.03)


def test_a_film_drags_with_c_m_v_and_less_with_height() -> None:
    pull = force("viscous_film", 2.5, v=moving(0.1, -0.2))
    assert pull == pytest.approx(-2.5 * 0.002 * (1 - 0.008 / 0.02) * moving(0.1, -0.2))
    lifted = moment().x + np.array([0.0, 0.0, 0.02])
    assert not force("viscous_film", 2.5, v=moving(0.1, 0.0), x=lifted).any()


def test_quadratic_drag_grows_with_the_square_of_speed() -> None:
    slow, fast = (force("quadratic_drag", 40.0, v=moving(speed, 0.0))[:, 0] for speed in (0.1, 0.2))
    assert slow == pytest.approx(-40.0 * 0.002 * 0.1**2)
    assert fast == pytest.approx(4 * slow)


def test_anisotropic_friction_is_the_same_forth_and_back_and_otherwise_across() -> None:
    along, back, across = (
        friction("friction_anisotropy", 0.2, 0.0, v=v) for v in (moving(0.1, 0), moving(-0.1, 0), moving(0, 0.1))
    )
    assert along == pytest.approx(1.2, abs=1e-3)
    assert back == pytest.approx(along)
    assert across == pytest.approx(0.8, abs=1e-3)
    assert friction("friction_anisotropy", 0.0, 0.2, v=moving(0.1, 0.1)) == pytest.approx(1.2, abs=1e-3)
    assert friction("friction_anisotropy", 0.2, 0.2) == pytest.approx(1.0)


def test_a_friction_map_grows_along_its_slope() -> None:
    assert friction("friction_map", 1.0, 0.0) == pytest.approx(1 - 0.05)
    here = friction("friction_map", 0.0, 2.0)
    assert here == pytest.approx(1 + 2.0 * moment().x[:, 1])
    assert friction("friction_map", 30.0, 0.0) == pytest.approx(0.05)


def test_stribeck_friction_is_greater_at_rest_and_gone_when_fast() -> None:
    at = [friction("stribeck", 0.4, 0.02, v=moving(speed, 0.0))[0] for speed in (0.0, 0.02, 0.2)]
    assert at == pytest.approx([1.4, 1 + 0.4 / np.e, 1.0])


def test_friction_drifts_from_the_first_to_the_last_push() -> None:
    at = [friction("friction_drift", 0.4, session=session)[0] for session in (-0.5, 0.0, 0.5)]
    assert at == pytest.approx([0.8, 1.0, 1.2])


@pytest.mark.parametrize(("when", "before", "after"), [(0.2, 1.0, np.exp(0.5)), (-0.2, np.exp(-0.5), 1.0)])
def test_an_abrupt_change_leaves_the_middle_of_the_session_as_it_is(when: float, before: float, after: float) -> None:
    first, last = (friction("abrupt_change", 0.5, -0.3, when, session=session) for session in (-0.5, 0.5))
    assert first == pytest.approx(before)
    assert last == pytest.approx(after)
    hook = effect("abrupt_change").stiffness
    assert hook is not None
    stiffer, softer = (hook(moment(session=session), np.array([0.5, -0.3, when]))[0] for session in (-0.5, 0.5))
    assert softer / stiffer == pytest.approx(np.exp(-0.3))


def test_vibration_comes_and_goes_with_its_frequency() -> None:
    at = [friction("vibration", 0.5, 2.0, time_s=7.0 + part / 8)[0] for part in range(5)]
    assert at == pytest.approx([1.0, 1.5, 1.0, 0.5, 1.0])


def test_what_the_finger_touches_does_not_roll() -> None:
    gap = np.full(40, 0.05)
    gap[7] = 0.0
    here = friction("rolling_resistance", 0.5, gap_m=gap)
    assert here[7] == 1.0
    assert np.delete(here, 7) == pytest.approx(0.5)


def test_adhesion_pulls_towards_the_finger_what_leaves_it_and_nothing_else() -> None:
    near = {"toward": np.tile([1.0, 0.0, 0.0], (40, 1)), "gap_m": np.full(40, 1e-3)}
    leaving = force("adhesion", 40.0, tool_v=np.array([0.1, 0.0, 0.0]), **near)
    assert leaving[:, 0] == pytest.approx(40.0 * 0.01 * 0.016)
    assert not force("adhesion", 40.0, tool_v=np.array([-0.1, 0.0, 0.0]), **near).any()
    assert not force("adhesion", 40.0, tool_v=np.array([0.1, 0.0, 0.0])).any()


def test_a_snag_holds_what_lies_over_it_and_never_turns_it_round() -> None:
    for rate in (125.0, 1e6):
        v = moving(0.1, 0.0)
        slowed = v + force("point_constraint", rate, 0.5, 0.005, v=v) * 0.002 / 0.002
        assert np.all(slowed[:, 0] > 0)
        assert slowed[20, 0] == pytest.approx(0.1 / (1 + rate * 0.002), rel=0.05)
        assert slowed[0, 0] > 0.09 or rate == 1e6


def test_attraction_is_largest_five_centimetres_from_its_point() -> None:
    x = moment().x.copy()
    x[:, 1], x[:, 0] = 0.0, 0.5 - np.linspace(0.01, 0.4, 40)
    pull = force("point_attraction", 0.1, 0.5, 0.0, x=x)
    assert np.argmax(pull[:, 0]) == 4
    assert pull[4, 0] == pytest.approx(0.1 * 0.002 * 9.81)
    assert np.all(force("point_attraction", -0.1, 0.5, 0.0, x=x)[:, 0] < 0)


def test_a_swirl_is_across_the_way_to_its_middle_and_grows_with_it() -> None:
    pull, away = force("swirl", 8.0, 0.4, 0.1), moment().x[:, :2] - np.array([0.4, 0.1])
    assert np.abs((pull[:, :2] * away).sum(1)).max() < 1e-12
    assert np.linalg.norm(pull, axis=1) == pytest.approx(0.002 * 8.0 * np.linalg.norm(away, axis=1))


def test_sideways_drift_does_no_work() -> None:
    v = moving(0.1, 0.05)
    pull = force("sideways_drift", 0.15, v=v)
    assert np.abs((pull * v).sum(1)).max() < 1e-12
    assert np.linalg.norm(pull, axis=1) == pytest.approx(0.15 * 0.002 * 9.81, rel=0.01)


def pushed(table: RopeWorld, start: tuple[float, float], end: tuple[float, float], speed_m_s: float) -> np.ndarray:
    """The rope at the end of a straight push."""
    begin, finish = np.array([*start, PUSH_Z]), np.array([*end, PUSH_Z])
    table.place(begin)
    ticks = round(float(np.linalg.norm(finish - begin)) / speed_m_s / 0.01)
    for tick in range(1, ticks + 1):
        table.step(begin + (finish - begin) * tick / ticks, 0.01)
    return table.nodes()


def test_a_hidden_post_holds_the_rope_and_lets_the_finger_pass() -> None:
    post = injected("hidden_obstacle", 417.0, 0.54, 0.10)
    free, held = (pushed(world(*hidden), (0.47, 0.0), (0.60, 0.0), 0.2) for hidden in ((), (post,)))
    behind = np.abs(free[:, 1] - 0.10) < 0.03
    assert held[behind, 0].mean() < free[behind, 0].mean() - 0.005
    table = world(post)
    pushed(table, (0.60, 0.10), (0.52, 0.10), 0.2)
    assert table.tip == pytest.approx(np.array([0.52, 0.10, PUSH_Z]), abs=1e-6)


def test_a_rope_with_rest_curvature_curls_by_it_on_ice() -> None:
    table = world(injected("rest_curvature", 3.0), injected("viscous_film", 10.0), physics=ICE)
    table.step(table.tool, 6.0)
    steps = np.diff(table.nodes()[:, :2], axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert turns[5:-5].mean() == pytest.approx(3.0 * ROPE.length_m / 40, rel=0.1)


def test_the_far_end_is_heavier_or_stiffer_by_the_exponential_of_the_slope() -> None:
    hook = effect("stiffness_heterogeneity").stiffness
    assert hook is not None
    slope, bow = (hook(moment(), np.array(values)) for values in ([0.5, 0.0], [0.0, 0.4]))
    assert np.log(slope[-1] / slope[1]) == pytest.approx(0.5 * 2 * 38 / 40)
    assert bow[20] == 1.0
    assert np.log(bow[0]) == pytest.approx(1.5 * 0.4)
    spec, build = mujoco.MjSpec(), effect("mass_heterogeneity").build
    add_rope(spec, ROPE, WorldPhysics(), resample(straight_rope(), 41))
    assert build is not None
    build(spec, WorldPhysics(), np.array([0.5, 0.0]))
    model = spec.compile()
    mass = model.body_mass[[model.body(f"rope{index}").id for index in range(40)]]
    assert np.log(mass[-1] / mass[0]) == pytest.approx(0.5 * 2 * 39 / 40)
    assert mass[19] * mass[20] == pytest.approx((ROPE.mass_kg / 40) ** 2)


def test_viscosity_and_yield_become_damping_and_yield_of_the_hinges() -> None:
    own, rope = WorldPhysics(), RopePhysics()
    voigt, yields = effect("kelvin_voigt").physics, effect("plastic_yield").physics
    assert voigt is not None
    assert yields is not None
    added = voigt(own, ROPE, np.array([10.0])).rope.bend_damping_n_m_s_rad - rope.bend_damping_n_m_s_rad
    assert added == pytest.approx(3 * 10.0 * np.pi * 0.008**4 / 4 / 0.01)
    E = rope.bend_stiffness_n_m_rad * 0.01 / (np.pi * 0.008**4 / 4)
    bend = yields(own, ROPE, np.array([0.012])).rope.bend_yield_rad
    assert np.sqrt(2 / 3) * E * (bend / 0.01) * 0.008 == pytest.approx(1 / 0.012)
    assert yields(own, ROPE, np.array([1e-6])).rope.bend_yield_rad == rope.bend_yield_rad


def test_a_maxwell_rope_forgets_its_bend_at_the_rate_r() -> None:
    hook = effect("maxwell").relaxed
    assert hook is not None
    left = 1.0
    for _ in range(500):
        left *= 1 - hook(0.002, np.array([2.0]))
    assert left == pytest.approx(np.exp(-2.0))


def test_a_compliant_finger_stays_behind_by_no_more_than_its_load_bends_it() -> None:
    table = world(injected("tool_compliance", 0.02))
    pushed(table, (0.47, 0.0), (0.58, 0.0), 0.1)
    # The finger's round end presses on the rope and makes its friction greater, by less than a half.
    friction_n = 0.5 * ROPE.mass_kg * 9.81
    assert 1e-3 < table.tool[0] - table.tip[0] < 0.02 * 1.5 * friction_n
    # Nothing but what little the rope's own bend presses is left of it at rest, and nothing in the air.
    table.step(np.array([0.58, 0.0, 0.1]), 0.5)
    assert table.tip == pytest.approx(table.tool[:3], abs=1e-5)


def test_a_rougher_finger_is_what_its_coefficient_says() -> None:
    hook = effect("finger_friction").physics
    assert hook is not None
    assert hook(WorldPhysics(), ROPE, np.array([0.6])) == dataclasses.replace(WorldPhysics(), finger_friction=0.6)


def test_a_delayed_arm_is_behind_by_its_speed_times_the_delay() -> None:
    moved = track().positions[:, 0] - driven("command_delay", 0.1)[:, 0]
    assert moved[60] == pytest.approx(0.1 * 0.1)
    assert moved[110] == pytest.approx(0.0)


def test_a_lagging_arm_is_behind_by_its_speed_times_the_time_constant_and_arrives() -> None:
    moved = track().positions[:, 0] - driven("actuator_lag", 0.08)[:, 0]
    assert moved[70] == pytest.approx(0.1 * 0.08, rel=0.01)
    assert abs(moved[120]) < 1e-5


def test_an_arm_that_reaches_too_short_leaves_out_its_share_of_the_stroke() -> None:
    moved = track().positions - driven("under_reach", 0.03)
    assert moved[100] == pytest.approx(np.array([0.03 * 0.1, 0.0, 0.0]))
    assert moved[20] == pytest.approx(np.zeros(3))


def test_backlash_is_taken_up_anew_after_a_reversal() -> None:
    x = driven("backlash", 0.002)[:, 0]
    assert track().positions[100, 0] - x[100] == pytest.approx(0.001)
    assert x[-1] - track().positions[-1, 0] == pytest.approx(0.001)


def test_a_tip_that_is_mounted_askew_turns_with_the_tool() -> None:
    offset = np.array([0.003, 0.001, -0.002])
    for yaw in (0.0, 1.0, np.pi):
        moved = driven("tcp_offset", *offset, yaw=yaw) - track().positions
        assert moved == pytest.approx(np.tile(Rotation.from_rotvec([0, 0, yaw]).apply(offset), (len(moved), 1)))


def seen_at(name: str, values: np.ndarray, middle: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Places that the calibration assigns to points `x` seen by a camera that the effect has displaced."""
    believed, stands = table_cameras()[1].T_world_camera, effect(name).stands
    assert stands is not None
    true = stands(believed, middle, values)
    points = np.column_stack([x, np.ones(len(x))])
    return (points @ (believed @ np.linalg.inv(true)).T)[:, :3]


def test_what_misplaced_cameras_see_is_displaced_or_turned_about_their_middle() -> None:
    x, middle = np.random.default_rng(0).uniform(-1, 1, (20, 3)), np.array([0.55, 0.0, 0.63])
    shift, turn = np.array([0.003, -0.001, 0.002]), np.array([0.5, -0.2, 0.3])
    assert seen_at("hand_eye_translation", shift, middle, x) == pytest.approx(x + shift)
    turned = middle + Rotation.from_rotvec(np.radians(turn)).apply(x - middle)
    assert seen_at("hand_eye_rotation", turn, middle, x) == pytest.approx(turned)


def shot(camera: CameraModel) -> SensorImages:
    table = world()
    table.step(table.tool, 0.2)
    color, depth = render(
        table.snapshot(), camera, np.random.default_rng(0), stage=Stage(body=ROPE, tool=FINGER), noise=NOISELESS
    )
    return SensorImages(color, depth, camera, ROPE.colour)


def looked(name: str, value: float, image: SensorImages) -> np.ndarray:
    hook = effect(name).seen
    assert hook is not None
    return hook(image, np.array([value]))


def test_depth_is_longer_by_its_share_or_by_its_bias_along_the_rays() -> None:
    image = shot(table_cameras()[0])
    scaled, biased = looked("depth_scale", 0.02, image), looked("depth_bias", 0.005, image)
    assert scaled / image.depth == pytest.approx(1.02, abs=1e-3)
    row, column = 20, 30
    ray = np.linalg.inv(image.camera.K) @ np.array([column, row, 1.0])
    longer = (biased[row, column] - image.depth[row, column] * 1.0) * image.camera.depth_unit_m * np.linalg.norm(ray)
    assert longer == pytest.approx(0.005, abs=0.7e-3)
    holes = image._replace(depth=np.zeros_like(image.depth))
    assert not looked("depth_bias", 0.005, holes).any()


def test_erosion_loses_a_rim_of_the_object_and_of_nothing_else() -> None:
    image = shot(table_cameras()[0])
    rope = (image.color[..., 0].astype(int) > image.color[..., 1].astype(int) + 60).sum()
    lost = [((looked("mask_erosion", width, image) == 0) & (image.depth > 0)).sum() for width in (0.001, 0.002)]
    # The rope is 16 mm wide, and a rim is lost on either side.
    assert lost[0] / rope == pytest.approx(2 * 0.001 / 0.016, rel=0.5)
    assert lost[1] / rope == pytest.approx(2 * 0.002 / 0.016, rel=0.35)


def test_images_are_later_than_their_stamps_by_the_offset() -> None:
    hook = effect("camera_time_offset").late_s
    assert hook is not None
    assert hook(np.array([-0.03])) == -0.03
