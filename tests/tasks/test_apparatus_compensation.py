"""Errors of cameras and arm are corrected: in observations, in commands to the arm, and so in predictions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.config import Site
from app.core.geometry.bowls import cap_depth_m, centre_of_bowl
from app.core.messages import Branch, Executed, Extension, Model, Parameter, Transition, fresh_id
from app.core.motion import TOOL_DOWN, Motion
from app.core.types import Points, ToolPose
from app.discovery.dataset.labels import places_along
from app.discovery.dataset.model_under_test import RodModel
from app.discovery.sensor_actuator_errors.base import Load
from app.jobs.apparatus_compensation import Correction, correction
from app.jobs.discovery_subject import subject_of
from app.jobs.worker_api import nominal_model
from app.perception.body.resample import resample
from app.perception.body.vessels import Pool, Vessel
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest
from app.policy.base import PARKED_POSE
from app.tasks import load
from tests.discovery.pours import BOWLS, COUNT, water
from tests.planner.table import SPACE, rope

SITE = Site()
SENSING = {
    "hand_eye_x": 0.006,
    "hand_eye_turn_z": 0.6,
    "depth_scale": 0.008,
    "depth_bias": 0.004,
    "mask_erosion": 0.001,
}
WAYS = {"tcp_y": 0.006, "under_reach": 0.05, "backlash": 0.002, "tool_compliance": 0.05}
"""Errors that change the path of the tip; those of `WHEN` change only its times."""
WHEN = {"command_delay": 0.1, "actuator_lag": 0.08, "camera_time_offset": 0.03}
NO_LOAD = Load(np.zeros((23, 3)))


def model(**apparatus: float) -> Model:
    """The nominal model with these errors of cameras and arm."""
    return replace(
        nominal_model("rope_push"),
        apparatus=tuple(
            Parameter(name=name, value=value, unit="1", low=value, high=value) for name, value in apparatus.items()
        ),
        extension=Extension(camera_m=(0.55, -0.25, 0.95)),
    )


def curved() -> Motion:
    """A push through the rope that turns back at its end."""
    angle = np.linspace(-1.2, 2.2, 20)
    steps = 0.006 * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return SPACE.motion(np.concatenate([[0.55, -0.03], steps.ravel()]).astype(np.float32), PARKED_POSE, SITE)


def told(error: Correction, motion: Motion, before: Points, after: Points) -> Motion:
    return error.command(motion, before, after, SITE)


@pytest.mark.parametrize("name", SENSING)
def test_what_the_cameras_show_is_undone_to_a_tenth_of_a_millimetre(name: str) -> None:
    error, true = correction(model(**{name: SENSING[name]})), rope(0.05, 0.3)
    shown = error.observe(true)
    assert np.abs(shown - true).max() > 5e-4
    np.testing.assert_allclose(error.unproject(shown), true, atol=1e-4)


@pytest.mark.parametrize("name", WAYS)
def test_an_arm_that_is_told_the_command_makes_the_motion(name: str) -> None:
    error, motion, before = correction(model(**{name: WAYS[name]})), curved(), rope()
    felt = error._drag_load(motion, before, rope(0.03))
    assert np.abs(error.executed_path(motion.positions, felt) - motion.positions).max() > 1e-3
    command = told(error, motion, before, rope(0.03))
    np.testing.assert_allclose(error.executed_path(command.positions, felt), motion.positions, atol=1e-5)
    np.testing.assert_array_equal(command.speeds, motion.speeds)


def test_a_paddle_that_is_held_elsewhere_is_told_the_same_turns_and_goes_where_it_should() -> None:
    task = load("bean_sweep")
    beans = replace(model(tcp_x=0.006, tcp_y=-0.004), task="bean_sweep")
    error, cloud = correction(beans), task.problems.particles(task.problems.start(2), 60)
    motion = task.actions.motion(np.array([0.45, -0.1, 0.6, 0.1], np.float32), PARKED_POSE, SITE)
    command = told(error, motion, cloud, cloud)
    np.testing.assert_array_equal(command.turns, motion.turns)
    offsets = (motion.positions - command.positions)[:, :2]
    np.testing.assert_allclose(np.linalg.norm(offsets, axis=1), np.hypot(0.006, 0.004), atol=1e-6)
    turned = Rotation.from_quat(motion.turns, scalar_first=True).apply([0.006, -0.004, 0.0])
    np.testing.assert_allclose(offsets, turned[:, :2], atol=1e-6)


def test_several_errors_at_once_are_undone_together() -> None:
    error, motion = correction(model(**WAYS)), curved()
    command = told(error, motion, rope(), rope(0.03))
    felt = error._drag_load(motion, rope(), rope(0.03))
    np.testing.assert_allclose(error.executed_path(command.positions, felt), motion.positions, atol=1e-5)


@pytest.mark.parametrize("name", WHEN)
def test_what_comes_late_goes_the_same_way(name: str) -> None:
    motion = curved()
    command = told(correction(model(**{name: WHEN[name]})), motion, rope(), rope(0.03))
    np.testing.assert_allclose(command.positions, motion.positions, atol=1e-5)


def test_a_command_stays_above_the_floor_of_the_workspace() -> None:
    command = told(correction(model(tcp_z=-0.005)), curved(), rope(), rope(0.03))
    assert command.positions[:, 2].min() == SITE.limits.workspace.low[2]
    assert SITE.limits.workspace.contains(command.positions)


def test_a_prediction_that_is_not_finite_is_commanded_and_shown_all_the_same() -> None:
    error, lost = correction(model(tool_compliance=0.05, hand_eye_x=0.004)), np.full_like(rope(), np.nan)
    assert np.isfinite(told(error, curved(), rope(), lost).positions).all()
    assert np.isnan(error.observe(lost)).all()


def transition(measured: bool) -> Transition:
    """A straight push of 10 cm."""
    x = np.concatenate([np.full(5, 0.5), np.linspace(0.5, 0.6, 50), np.full(5, 0.6)])
    z = np.concatenate([np.linspace(0.12, 0.006, 5), np.full(50, 0.006), np.linspace(0.006, 0.12, 5)])
    poses = np.column_stack([x, np.zeros_like(x), z, np.tile(TOOL_DOWN, (60, 1))])
    executed = Executed(
        id=fresh_id("executed"),
        time_s=1.0,
        approved_id=fresh_id("approved"),
        outcome="completed",
        reason="",
        times_s=np.linspace(0, 1.2, 60),
        commanded=poses,
        measured=poses if measured else poses[:0],
    )
    return Transition(id=fresh_id("transition"), time_s=2.0, before=rope(), executed=executed, after=rope(0.02))


def test_what_an_arm_measures_of_itself_is_not_taken_off_twice() -> None:
    error = correction(model(under_reach=0.1, tcp_x=0.004))
    ends = [error.transition(transition(measured)).executed.made[-1, 0] for measured in (True, False)]
    np.testing.assert_allclose(ends, [0.604, 0.594], atol=1e-9)


def test_a_transition_is_where_it_really_was() -> None:
    seen = transition(measured=True)
    true = correction(model(hand_eye_y=0.005)).transition(seen)
    for shown, real in ((seen.before, true.before), (seen.after, true.after)):
        np.testing.assert_allclose(real, shown - np.float32([0, 0.005, 0]), atol=1e-6)
    np.testing.assert_array_equal(true.executed.made, seen.executed.made)


def test_cameras_that_are_wrong_move_no_water_into_a_bowls_wall() -> None:
    error = correction(replace(model(hand_eye_z=0.01, depth_bias=0.004), task="pour_water"))
    seen = water(0.3, np.array([0.42, 0.05, 0.144]))
    np.testing.assert_array_equal(error.unproject(seen), seen)
    np.testing.assert_array_equal(error.observe(seen), seen)


def test_water_in_the_hand_is_where_the_arm_truly_has_it() -> None:
    error = correction(replace(model(tcp_z=0.004, hand_eye_z=0.01), task="pour_water"))
    push = transition(measured=True)
    poses = push.executed.measured + np.array([-0.1, 0.05, 0.1, 0.0, 0.0, 0.0, 0.0])
    ends = poses[[0, -1], :3]
    executed = replace(push.executed, commanded=poses, measured=poses)
    seen = replace(push, before=water(0.0, ends[0]), executed=executed, after=water(0.3, ends[1]))
    true = error.transition(seen)
    carried = true.executed.made[0, :3] - ends[0]
    assert np.linalg.norm(carried) == pytest.approx(0.004, abs=1e-6)
    np.testing.assert_allclose(true.before, seen.before + carried, atol=1e-6)
    poured = round(0.3 * COUNT)
    assert BOWLS.share(true.after) == pytest.approx(0.3, abs=1e-6)
    np.testing.assert_array_equal(true.after[:poured], seen.after[:poured])
    np.testing.assert_allclose(true.after[poured:], seen.after[poured:] + carried, atol=1e-6)


HELD = np.array([0.42, 0.05, 0.144])
"""Place of the bowl in the hand [m]."""
FULLER = replace(model(fill_level=0.2), task="pour_water")


def hand(place: np.ndarray = HELD) -> ToolPose:
    return np.array([*place, *TOOL_DOWN, 0.0])


def height_m(points: Points) -> float:
    return float(np.quantile(points[:, 2], 0.99))


@pytest.mark.parametrize(
    ("more", "share"), [(0.2, 0.0), (0.2, 0.5), (-0.2, 0.3), (-0.2, 0.8), (-0.2, 0.79), (0.01, 0.003)]
)
def test_every_particle_of_a_liquid_is_an_equal_share_of_all_that_there_is(more: float, share: float) -> None:
    error, seen = correction(replace(model(fill_level=more), task="pour_water")), water(share, HELD)
    before = seen.copy()
    true = error.unproject(seen, hand())
    np.testing.assert_array_equal(seen, before)
    assert len(true) == COUNT
    assert BOWLS.share(true) == pytest.approx(share / (1 + more), abs=1 / COUNT)
    held = true[~BOWLS.inside(true)]
    assert BOWLS.holds(held, HELD).all()
    depth_m = cap_depth_m((1 + more - share) * BOWLS.volume_m3, BOWLS.held_radius_m)
    if len(held):
        assert height_m(held) == pytest.approx(HELD[2] - BOWLS.held_radius_m + depth_m, abs=0.004)
        assert BOWLS.share(error.observe(true)) == pytest.approx(share, abs=2 / COUNT)


@pytest.mark.parametrize("poured", [1.0, 1.05, 1.1, 1.25])
@pytest.mark.parametrize("task", ["pour_water", "pour_water-hard"])
def test_what_stands_higher_than_a_reconstruction_has_particles_for_is_seen_by_its_level(
    task: str, poured: float
) -> None:
    """A pour of a fuller bowl is done when all of it is poured, of which the reconstruction knows a part.

    More than the bowl holds is spilt.
    """
    bowls = subject_of(load(task)).bowls
    assert bowls is not None
    poured = min(poured, 2 / 3 * np.pi * bowls.radius_m**3 / bowls.volume_m3)
    error = correction(replace(model(fill_level=0.25), task=task))
    level_m = bowls.place_m[2] - bowls.radius_m + cap_depth_m(poured * bowls.volume_m3, bowls.radius_m)
    pool = Pool(vessel=Vessel(radius_m=bowls.radius_m, place_m=bowls.place_m), level_m=level_m)
    seen = resample(pool.points(0.002), COUNT, seed=0)
    assert bowls.share(error.unproject(seen, hand())) == pytest.approx(poured / 1.25, abs=0.03)


def test_a_soups_pieces_stay_in_their_bowl_and_rise_with_the_level() -> None:
    error, task = correction(replace(FULLER, task="pour_soup")), load("pour_soup")
    seen = task.particles(task.start(0), COUNT)
    place = centre_of_bowl(task.start(0), BOWLS.held_radius_m, BOWLS.volume_m3)
    true, drops = error.unproject(seen, hand(place)), task.scene.split(COUNT)[0]
    assert BOWLS.holds(true, place).all()
    assert (true[drops:, 2] - seen[drops:, 2]).mean() > 0.002
    assert height_m(true[:drops]) > height_m(seen[:drops]) + 0.002


def test_where_no_tool_is_told_nothing_is_known_of_a_held_bowl() -> None:
    np.testing.assert_array_equal(correction(FULLER).unproject(water(0.4, HELD)), water(0.4, HELD))


def test_a_transition_of_a_fuller_bowl_is_of_all_that_there_is() -> None:
    push = transition(measured=True)
    poses = push.executed.measured + np.array([-0.1, 0.05, 0.1, 0.0, 0.0, 0.0, 0.0])
    executed = replace(push.executed, commanded=poses, measured=poses)
    seen = replace(push, before=water(0.0, poses[0, :3]), executed=executed, after=water(0.6, poses[-1, :3]))
    true = correction(FULLER).transition(seen)
    assert BOWLS.holds(true.before, poses[0, :3]).all()
    assert height_m(true.before) > height_m(seen.before) + 0.002
    assert BOWLS.share(true.after) == pytest.approx(0.5, abs=1 / COUNT)


def test_a_motion_that_goes_on_begins_where_the_arm_says_that_the_tool_is() -> None:
    """The plan is for the bowl and its content where they truly are."""
    error, told = correction(replace(model(tcp_x=0.012, tcp_z=-0.003), task="pour_water")), hand()
    asked = list[PlanRequest]()

    def planner(request: PlanRequest) -> Plan:
        asked.append(request)
        assert request.tool is not None
        assert request.command is not None
        way = Motion(
            positions=request.tool[:3] + np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]]),
            speeds=np.full(2, 0.1),
            continues=True,
        )
        motion = request.command(way, request.observed, request.observed)
        return Plan(
            branches=(idle_branch(request.observed),),
            best=0,
            motion=motion,
            predicted=request.observed,
            centreline=np.zeros((2, 0), np.float32),
            chamfer_m2=0.0,
            predicted_chamfer_m2=0.0,
        )

    seen = water(0.0, HELD)
    found = error.plan(planner, PlanRequest(observed=seen, goal=seen, phi=np.zeros(1, np.float32), tool=told))
    (request,) = asked
    assert request.tool is not None
    np.testing.assert_allclose(request.tool[:3] - told[:3], [0.012, 0.0, 0.003], atol=1e-6)
    np.testing.assert_array_equal(request.tool[3:], told[3:])
    np.testing.assert_array_equal(request.told_tool, told)
    np.testing.assert_allclose(request.observed - seen, np.tile([0.012, 0.0, 0.003], (COUNT, 1)), atol=1e-6)
    np.testing.assert_allclose(found.motion.positions[0], told[:3], atol=1e-6)


def idle_branch(x: Points) -> Branch:
    return Branch(
        origin="random",
        actions=np.zeros((1, 6), np.float32),
        tool_path=np.zeros((2, 3), np.float32),
        predicted=x,
        final=x,
        cost_before=0.0,
        cost_after=0.0,
        terms={},
        finite=True,
    )


@pytest.mark.parametrize(("name", "searches"), [("tcp_y", 0), ("hand_eye_x", 0), ("mask_erosion", 1)])
def test_where_along_the_rope_its_particles_are_is_found_once_a_plan_and_where_cameras_show_it_alone(
    monkeypatch: pytest.MonkeyPatch, name: str, searches: int
) -> None:
    error, asked = correction(model(**{name: 0.001})), list[Points]()

    def counted(points: Points, rods: RodModel | None = None) -> np.ndarray:
        asked.append(points)
        return places_along(points, rods)

    def planner(request: PlanRequest) -> Plan:
        """Three branches in which the rope moves on."""
        frames = np.stack([request.observed + np.float32([0.004 * k, 0, 0]) for k in range(5)])
        branches = (replace(idle_branch(frames[-1]), frames=frames, tools=np.zeros((5, 3), np.float32)),) * 3
        return Plan(
            branches=branches,
            best=0,
            motion=curved(),
            predicted=frames[-1],
            centreline=np.zeros((2, 0), np.float32),
            chamfer_m2=0.0,
            predicted_chamfer_m2=0.0,
        )

    seen = rope()
    request = PlanRequest(observed=seen, goal=rope(0.04), phi=np.zeros(1, np.float32))
    monkeypatch.setattr("app.jobs.apparatus_compensation.places_along", counted)
    plan = error.plan(planner, request)
    during = len(asked) - (name == "mask_erosion")  # Once where the rope that cameras show truly is.
    assert during == searches
    for branch in plan.branches:
        for k, frame in enumerate(branch.frames):
            off = np.abs(frame - seen - np.float32([0.004 * k, 0, 0]))
            assert float(off.mean()) < 1e-4
            assert float(off.max()) < 8e-4
