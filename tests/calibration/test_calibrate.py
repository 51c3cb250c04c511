"""Calibration of the real simulator: its own hidden parameters are recovered from its own transitions."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from app.calibration.calibrate import Calibrator, next_model, phi_of
from app.calibration.evidence import Evidence, ModelScorer, gather
from app.calibration.fit import FitSettings
from app.core.messages import Executed, Extension, MessageId, Parameter, Transition
from app.jobs import jit_cache
from app.jobs.worker_api import nominal_model
from app.policy.base import PARKED_POSE
from app.sim.model.params import PARAMETERS, index
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push")
SPACE = replace(TASK.actions, push_substeps=120, rest_substeps=8)
PARTICLES = 80
PREDICTOR = ModelScorer(advance=jit_cache.advance("rope_push", PARTICLES), chunk=4)
TRUTH = phi_of(nominal_model("rope_push"))
FRICTION = (PARAMETERS[index("table_friction")],)


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    """Five pushes of the simulator itself, with the true parameters."""
    rng = np.random.default_rng(0)
    before = np.stack([fill_tube(TASK.start(seed), TASK.rope.radius_m, PARTICLES) for seed in range(5)])
    actions = jnp.concatenate([jnp.asarray(SPACE.sample(rng, x, PARKED_POSE, 1)) for x in before])
    tool = SPACE.tool_path(actions, jnp.tile(jnp.asarray(PARKED_POSE, jnp.float32), (5, 1)))
    after = PREDICTOR.advance(jnp.tile(TRUTH, (5, 1)), jnp.asarray(before), tool)
    return Evidence(before=before, tool=np.asarray(tool), after=np.asarray(after))


def wrong(name: str, factor: float) -> np.ndarray:
    phi = TRUTH.copy()
    phi[index(name)] *= factor
    return phi


def test_the_truth_predicts_best_and_a_last_chunk_that_is_not_full_is_cut_off(evidence: Evidence) -> None:
    losses = PREDICTOR.losses(TRUTH, evidence)
    assert losses.shape == (5,)
    np.testing.assert_allclose(losses, 0.0, atol=1e-9)
    assert PREDICTOR.losses(wrong("table_friction", 2.0), evidence).mean() > 1e-5


def test_the_gradient_of_the_losses_agrees_with_central_differences(evidence: Evidence) -> None:
    phi, column = wrong("table_friction", 1.5), index("table_friction")
    _, gradients = PREDICTOR.slopes(phi, evidence)
    h = 2e-3 * phi[column]
    ends = []
    for sign in (1, -1):
        moved = phi.copy()
        moved[column] += sign * h
        ends.append(PREDICTOR.losses(moved, evidence).astype(np.float64))
    secant = (ends[0] - ends[1]) / (2 * h)
    assert gradients[:, column].mean() == pytest.approx(secant.mean(), rel=0.1)


@pytest.mark.parametrize("factor", [1 / 3, 3.0])
def test_hidden_friction_is_recovered_from_a_start_wrong_by_a_factor_of_three(
    evidence: Evidence, factor: float
) -> None:
    calibrator = Calibrator(predictor=PREDICTOR, specs=FRICTION, settings=FitSettings(steps=8))
    found = calibrator.fit(evidence, wrong("table_friction", factor))
    assert found.values[0] == pytest.approx(TRUTH[index("table_friction")], rel=0.15)


def test_the_next_model_names_its_causes_and_changes_the_fitted_parameters_alone(evidence: Evidence) -> None:
    calibrator = Calibrator(predictor=PREDICTOR, specs=FRICTION, settings=FitSettings(steps=1))
    old = nominal_model("rope_push")
    transition = _transition(evidence, 0)
    new = next_model(old, calibrator.fit(evidence, wrong("table_friction", 1.3)), calibrator.names, [transition])
    assert (new.version, new.cause, new.time_s) == (1, (old.id, transition.id), transition.time_s)
    changed = [a.name for a, b in zip(new.parameters, old.parameters, strict=True) if a != b]
    assert changed == ["table_friction"]
    parameter = new.parameters[index("table_friction")]
    assert parameter.low <= parameter.value <= parameter.high


def test_the_next_model_keeps_what_cameras_and_arm_get_wrong(evidence: Evidence) -> None:
    found = Calibrator(predictor=PREDICTOR, specs=FRICTION, settings=FitSettings(steps=1)).fit(evidence, TRUTH)
    erring = Parameter(name="hand_eye_x", value=0.004, unit="m", low=0.003, high=0.005)
    extension = Extension(effects=("hand_eye_translation",), camera_m=(0.55, -0.25, 0.95))
    old = replace(nominal_model("rope_push"), apparatus=(erring,), extension=extension)
    new = next_model(old, found, ("table_friction",), [_transition(evidence, 0)])
    assert (new.apparatus, new.extension) == (old.apparatus, old.extension)


def test_what_is_simulated_is_the_measured_motion_and_not_the_commanded_one(evidence: Evidence) -> None:
    transition = _transition(evidence, 0)
    gathered = gather([transition], SPACE.measured_path)
    np.testing.assert_allclose(gathered.tool[0, -1, :2], transition.executed.measured[-1, :2], atol=1e-6)


def _transition(evidence: Evidence, k: int) -> Transition:
    measured = np.concatenate([evidence.tool[k], np.tile([0.0, 1.0, 0.0, 0.0], (len(evidence.tool[k]), 1))], axis=1)
    executed = Executed(
        id=MessageId("executed-1"),
        time_s=1.0,
        approved_id=MessageId("approved-1"),
        outcome="completed",
        reason="",
        times_s=np.linspace(0, 1, len(measured)),
        commanded=np.zeros((len(measured), 7)),
        measured=measured.astype(np.float64),
    )
    return Transition(
        id=MessageId("transition-1"),
        time_s=2.0,
        before=evidence.before[k],
        executed=executed,
        after=evidence.after[k],
    )
