"""Errors of cameras and arm are found without a simulation: in the seen finger, the bare table and the arm's log."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.geometry.track import Track
from app.core.measured_setup import FoundTable, MeasuredSetup, SourcedSize
from app.discovery.checks.direct_checks import direct_checks
from app.discovery.dataset.model_under_test import Theta, catalogue
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.inference.screen import prior_of
from app.discovery.inference.weighing import weigh
from app.discovery.residuals.direct_measurements import direct_blocks, direct_rows, row_of
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step, secant_of, steps_of
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.sensor_actuator_errors.base import Eye, Load
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import REGION, PushDesign, midway_s, random_track
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push")
SUBJECT, CATALOGUE = subject_of(TASK), catalogue()
PREDICTOR = Predictor(SUBJECT, CATALOGUE)
NOMINAL = CATALOGUE.nominal(SUBJECT)
CAMERA = (0.55, -0.25, 0.95)
STEPS = [step for step in steps_of(CATALOGUE, (), {}) if CATALOGUE.cause(step.cause).family in ("sensing", "actuation")]
SIZES = (
    ("hand_eye_x", 0.003),
    ("hand_eye_turn_y", 0.5),
    ("tcp_y", 0.003),
    ("camera_time_offset", 0.03),
    ("command_delay", 0.08),
    ("command_delay", 0.2),
    ("actuator_lag", 0.06),
    ("actuator_lag", 0.15),
    ("under_reach", 0.02),
    ("backlash", 0.001),
)
"""Delay and lag of twice the typical size, too: neither is a straight line in its time constant."""


def study(truth: Theta, seed: int = 0) -> Study:
    """Pushes whose clouds say nothing, with what the cameras say of finger and table, and the arm of itself."""
    rng = np.random.default_rng(seed)
    cloud = fill_tube(TASK.start(1), TASK.rope.radius_m, 300)
    eye, pushes = Eye(np.asarray(CAMERA), None), list[Push]()
    for number in range(24):
        command = random_track(rng, cloud, PushDesign(), start_s=5.0 * number, height_m=SUBJECT.low_m - 0.004)
        bare = Push(
            episode=number // 6,
            before=ProjectionView(time_s=command.times_s[0], points=cloud),
            during=(),
            after=ProjectionView(time_s=command.times_s[-1], points=cloud),
            command=command,
            measured=None,
        )
        true = PREDICTOR.actual_track(bare, Load(np.zeros((len(command.times_s), 3))), truth)
        told = PREDICTOR.encoder_track(command, Load(np.zeros((len(command.times_s), 3))), truth)
        poses = np.concatenate([told.at(command.times_s), command.poses[:, 3:]], axis=1)
        poses[:, :3] += rng.normal(0, 1e-4, (len(poses), 3))
        at = midway_s(command.times_s)
        tip = true.at(np.array([at + PREDICTOR.late_s(truth)])) + rng.normal(0, 1e-3, (60, 3))
        finger = PREDICTOR.observe(tip.astype(np.float32), eye, truth)
        pushes.append(
            Push(
                episode=bare.episode,
                before=bare.before,
                during=(ProjectionView(time_s=at, points=cloud, finger=finger),),
                after=bare.after,
                command=command,
                measured=Track(times_s=command.times_s, poses=poses),
            )
        )
    tables = {episode: _table(rng, truth) for episode in range(4)}
    return Study(task="rope_push", pushes=tuple(pushes), tables=tables, camera=CAMERA)


def _table(rng: np.random.Generator, truth: Theta) -> np.ndarray:
    level = np.concatenate([rng.uniform(REGION[:2], REGION[2:], (400, 2)), np.zeros((400, 1))], axis=1)
    shown = PREDICTOR.observe(level.astype(np.float32), Eye(np.asarray(CAMERA), None), truth)
    return shown + rng.normal(0, 1e-3, (400, 3)).astype(np.float32)


def data(trials: SimulationBatch) -> Residuals:
    rows = direct_rows(PREDICTOR, trials, NOMINAL, [secant_of(PREDICTOR, trials, NOMINAL, step) for step in STEPS])
    episode = np.array([push.episode for push in trials.study.pushes])
    spread = np.zeros((*rows.r.shape, 1))
    return Residuals(r=rows.r, J=rows.J, spread=spread, known=rows.known, episode=episode, blocks=direct_blocks(0))


def ranked(truth: Theta) -> list[tuple[float, str, dict[str, float]]]:
    found = data(prepare(study(truth), SUBJECT))
    groups: dict[str, list[int]] = {}
    for column, step in enumerate(STEPS):
        groups.setdefault(step.cause, []).append(column)
    results = list[tuple[float, str, dict[str, float]]]()
    weighing = weigh(found, list(groups.values()), prior_of(CATALOGUE, (), NOMINAL, STEPS))
    for (cause, columns), what in zip(groups.items(), weighing.findings, strict=True):
        sizes = {
            CATALOGUE.specs[STEPS[column].column].name: float(value) * STEPS[column].size
            for column, value in zip(columns, what.mean, strict=True)
        }
        results.append((what.log_bayes, cause, sizes))
    return sorted(results, key=lambda result: -result[0])


def step_of(name: str) -> Step:
    return next(step for step in STEPS if CATALOGUE.specs[step.column].name == name)


@pytest.mark.parametrize(("name", "size"), SIZES)
def test_an_error_of_cameras_or_arm_is_named_with_its_size(name: str, size: float) -> None:
    truth = NOMINAL.copy()
    truth[CATALOGUE.column(name)] = size
    bayes, cause, sizes = ranked(truth)[0]
    assert bayes > 5.0
    assert cause == step_of(name).cause
    assert sizes[name] == pytest.approx(size, rel=0.3)


def test_where_cameras_and_arm_are_right_nothing_is_named() -> None:
    assert ranked(NOMINAL.copy())[0][0] < 1.0


def test_half_of_a_ropes_points_are_as_near_to_its_middle_as_its_radius_says() -> None:
    girth = data(prepare(study(NOMINAL.copy()), SUBJECT)).r[:, row_of("girth")]
    assert abs(float(np.median(girth))) < 0.5e-3


@pytest.mark.parametrize(("name", "size"), [("hand_eye_y", 0.008), ("hand_eye_turn_x", 0.5), ("depth_bias", 0.01)])
def test_a_rope_is_as_thick_wherever_cameras_that_err_show_it(name: str, size: float) -> None:
    trials, erring = prepare(study(NOMINAL.copy()), SUBJECT), NOMINAL.copy()
    erring[CATALOGUE.column(name)] = size
    right, moved = (direct_rows(PREDICTOR, trials, theta, []).r[:, row_of("girth")] for theta in (NOMINAL, erring))
    np.testing.assert_allclose(moved, right, atol=1e-4)


def test_a_check_is_off_by_more_than_the_least_error_alone() -> None:
    """A tenth of a millimetre that every episode shows is no reason to look for a cause."""
    truth = NOMINAL.copy()
    truth[CATALOGUE.column("hand_eye_x")] = 1e-4
    assert all(check.holds_null for check in direct_checks(PREDICTOR, prepare(study(truth), SUBJECT), NOMINAL))
    truth[CATALOGUE.column("hand_eye_x")] = 3e-3
    checks = direct_checks(PREDICTOR, prepare(study(truth), SUBJECT), NOMINAL)
    assert any(not check.holds_null for check in checks if check.name.startswith("tool"))
    assert all(check.holds_null for check in checks if not check.name.startswith(("tool", "camera")))


def test_how_low_a_tool_is_of_which_the_surface_alone_is_seen_is_no_check() -> None:
    radius_m, turns = 0.008, np.linspace(0, 2 * np.pi, 60, endpoint=False)
    around = np.stack([radius_m * np.cos(turns), radius_m * np.sin(turns), np.linspace(0.01, 0.05, 60)], axis=1)
    sizes = tuple(
        SourcedSize(name=f"finger_{name}", value=value, source="about")
        for name, value in (("radius_m", radius_m), ("half_width_m", 0.0))
    )
    whole = study(NOMINAL.copy())
    tips = [push.track.at(np.array([push.during[0].time_s])) for push in whole.pushes]
    pushes = tuple(
        replace(push, during=(replace(push.during[0], finger=(tip + around).astype(np.float32)),))
        for push, tip in zip(whole.pushes, tips, strict=True)
    )
    setup = MeasuredSetup(sizes=sizes, table=FoundTable(), tool_points="surface")
    checks = direct_checks(PREDICTOR, prepare(replace(whole, pushes=pushes, setup=setup), SUBJECT), NOMINAL)
    assert {check.name for check in checks if check.name.startswith("tool")} == {"tool, x", "tool, y"}


def test_what_was_not_measured_has_no_rows() -> None:
    bare = study(NOMINAL)
    bare = Study(
        task=bare.task,
        pushes=tuple(
            Push(
                episode=push.episode,
                before=push.before,
                during=(),
                after=push.after,
                command=push.command,
                measured=None,
            )
            for push in bare.pushes
        ),
        camera=CAMERA,
    )
    assert not data(prepare(bare, SUBJECT)).known[:, : row_of("girth").start].any()
