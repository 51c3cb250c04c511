"""Calibration on rods: bending, both frictions and the tool's offset of a hidden rope, from what cameras saw of it."""

from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

from app.calibration.evidence import gather
from app.calibration.fit import Fit, FitSettings
from app.core.errors import RecordingError
from app.core.messages import Executed, MessageId, Model, Transition
from app.core.motion import TOOL_DOWN
from app.jobs import jit_cache
from app.jobs.jit_cache import Calibrated, calibrate_model, calibrated_from_recordings, phi_of
from app.jobs.worker_api import check_model, ends_of_ranges, nominal_model, planner_needs, update
from app.sim.model.params import index
from bench.calibration_coverage import TASK, DataSet, Truth, data_set, fitted

STIFFEST_PA = next(spec.high for spec in TASK.parameters() if spec.name == "stiffness")
NAMES = ("stiffness", "table_friction", "finger_friction")


@cache
def hidden() -> DataSet:
    return data_set(0)


@cache
def found() -> Fit:
    return fitted(hidden().evidence)


@pytest.mark.parametrize("name", Truth._fields)
def test_the_truth_lies_in_its_interval(name: str) -> None:
    column = Truth._fields.index(name)
    assert found().low[column] <= getattr(hidden().truth, name) <= found().high[column]


def test_the_offset_of_the_tool_is_found_to_a_millimetre() -> None:
    truth = hidden().truth
    assert np.abs(found().values[3:] - [truth.tcp_x, truth.tcp_y]).max() < 1e-3
    assert (found().high - found().low)[3:].max() < 4e-3


def test_the_slope_by_the_offset_agrees_with_central_differences() -> None:
    calibrator = jit_cache.calibrator(TASK.name, "cpu", FitSettings(), phi_of(nominal_model(TASK.name)))
    phi, h = phi_of(nominal_model(TASK.name)), 3e-4

    def mean_loss(*shift: float) -> float:
        return float(calibrator.predictor.shifted_slopes(phi, np.float32(shift), hidden().evidence)[0].mean())

    slopes = calibrator.predictor.shifted_slopes(phi, np.zeros(2, np.float32), hidden().evidence)[2].mean(0)
    secants = [(mean_loss(h, 0) - mean_loss(-h, 0)) / (2 * h), (mean_loss(0, h) - mean_loss(0, -h)) / (2 * h)]
    assert slopes == pytest.approx(secants, rel=0.15, abs=2e-4)


def test_a_rope_begins_outside_of_compiled_code_as_within() -> None:
    before = hidden().evidence.before
    outside, within = jit_cache.states_at_rest(TASK.name)(before), TASK.initial_state(jnp.asarray(before))
    for mine, its in zip(outside, within, strict=True):
        np.testing.assert_allclose(mine, its, atol=1e-6)


@cache
def transitions() -> tuple[Transition, ...]:
    """The pushes as a recording has them."""
    evidence = hidden().evidence
    return tuple(_transition(evidence.before[k], evidence.tool[k], evidence.after[k], k) for k in range(len(evidence)))


@cache
def learnt() -> Model:
    return calibrated_from_recordings(
        TASK.name, "cpu", transitions(), nominal_model(TASK.name), FitSettings(probes=48)
    ).model


def test_a_model_of_recordings_says_where_the_tool_is_and_can_be_used() -> None:
    offset = {parameter.name: parameter for parameter in learnt().apparatus}
    assert sorted(offset) == ["tcp_x", "tcp_y"]
    assert offset["tcp_x"].value == pytest.approx(hidden().truth.tcp_x, abs=1.5e-3)
    check_model(learnt())
    changed = [a.name for a, b in zip(learnt().parameters, nominal_model(TASK.name).parameters, strict=True) if a != b]
    assert changed == list(NAMES)


def test_recordings_of_a_tool_that_is_where_the_arm_says_leave_it_there() -> None:
    evidence = hidden().evidence
    shift = _shift_m(hidden().truth)
    right = [_transition(evidence.before[k], evidence.tool[k] + shift, evidence.after[k], k) for k in range(10)]
    model = calibrated_from_recordings(TASK.name, "cpu", right, nominal_model(TASK.name), FitSettings(probes=48)).model
    assert all(abs(parameter.value) < 1e-3 for parameter in model.apparatus)


STIFF = Truth(stiffness=4.5e5, table_friction=0.5, finger_friction=0.3, tcp_x=0.0, tcp_y=0.0)


@cache
def stiff_transitions() -> tuple[Transition, ...]:
    """Pushes of a rope that the usual simulator does not bear."""
    evidence = data_set(0, truth=STIFF).evidence
    return tuple(_transition(evidence.before[k], evidence.tool[k], evidence.after[k], k) for k in range(len(evidence)))


@cache
def stiff() -> Calibrated:
    return calibrated_from_recordings(
        TASK.name, "cpu", stiff_transitions(), nominal_model(TASK.name), FitSettings(probes=24)
    )


def test_a_rope_much_stiffer_than_nominal_ropes_is_found_by_a_simulator_that_bears_it() -> None:
    found, stiffness = stiff().model, stiff().model.parameters[0]
    assert STIFF.stiffness > TASK.parameters(stiff=False)[0].high
    assert stiffness.value == pytest.approx(STIFF.stiffness, rel=0.4)
    assert stiffness.low <= STIFF.stiffness <= stiffness.high < STIFFEST_PA
    assert not ends_of_ranges(found)
    assert "a stiff rope" in planner_needs(found)
    check_model(found)
    right = phi_of(found)
    right[:2] = STIFF.stiffness, STIFF.table_friction
    right[index("finger_friction")] = STIFF.finger_friction
    predictor = jit_cache.calibrator(TASK.name, "cpu", FitSettings(), right).predictor
    losses = predictor.losses(right, gather(stiff_transitions(), TASK.actions.measured_path))
    assert found.loss_m2 < 1.1 * losses.mean()


def test_its_fit_begins_where_the_model_did() -> None:
    nominal = phi_of(nominal_model(TASK.name))
    assert stiff().trials[0].values[0] == pytest.approx(nominal[0])
    assert stiff().trials[0].loss_m2 > 10 * stiff().model.loss_m2


def test_a_stiff_model_that_is_fitted_again_keeps_its_interval() -> None:
    again = calibrate_model(
        TASK.name, "cpu", stiff_transitions(), stiff().model, FitSettings(probes=24)
    ).model.parameters[0]
    assert again.value == pytest.approx(STIFF.stiffness, rel=0.4)
    assert again.low <= STIFF.stiffness <= again.high < STIFFEST_PA


def test_a_limp_rope_is_found_from_a_stiff_model() -> None:
    found = calibrate_model(TASK.name, "cpu", transitions(), stiff().model, FitSettings()).model.parameters[0]
    assert found.value < TASK.parameters(stiff=False)[0].high
    assert found.value == pytest.approx(hidden().truth.stiffness, rel=0.4)


def test_a_model_in_use_keeps_its_simulator() -> None:
    usual = TASK.parameters(stiff=False)[0].high
    near = replace(nominal_model(TASK.name).parameters[0], value=0.98 * usual, low=0.98 * usual, high=0.98 * usual)
    model = replace(nominal_model(TASK.name), parameters=(near, *nominal_model(TASK.name).parameters[1:]))
    assert update(TASK.name, "cpu", stiff_transitions(), model).parameters[0].value <= usual


def test_an_interval_as_wide_as_a_simulator_goes_is_not_cut_there() -> None:
    one = calibrate_model(TASK.name, "cpu", transitions()[:1], nominal_model(TASK.name), FitSettings(steps=1)).model
    assert one.parameters[0].high == pytest.approx(STIFFEST_PA)
    assert learnt().parameters[0].high < TASK.parameters(stiff=False)[0].high


def test_what_tells_nothing_is_refused() -> None:
    aside = np.array([0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0])
    far = [
        replace(each, executed=replace(each.executed, measured=each.executed.measured + aside))
        for each in transitions()
    ]
    with pytest.raises(RecordingError, match="different frames"):
        calibrated_from_recordings(TASK.name, "cpu", far, nominal_model(TASK.name), FitSettings(probes=48))
    still = [replace(each, after=each.before) for each in far]
    with pytest.raises(RecordingError, match="touched nothing"):
        calibrated_from_recordings(TASK.name, "cpu", still, nominal_model(TASK.name), FitSettings(probes=48))


def test_an_estimate_at_the_end_of_its_range_is_said_to_be_one() -> None:
    nominal = nominal_model(TASK.name)
    ends = {
        "stiffness": (STIFFEST_PA, 5e4, STIFFEST_PA),
        "table_friction": (0.02, 0.02, 0.1),
        "finger_friction": (0.3, 0.2, 0.4),
    }
    parameters = tuple(
        replace(each, **dict(zip(("value", "low", "high"), ends[each.name], strict=True)))
        if each.name in ends
        else each
        for each in nominal.parameters
    )
    told = ends_of_ranges(replace(nominal, parameters=parameters))
    assert sorted(told) == ["stiffness", "table_friction"]
    assert "high end" in told["stiffness"]
    assert "low end" in told["table_friction"]
    assert not ends_of_ranges(nominal)


def _shift_m(truth: Truth) -> np.ndarray:
    offset = jit_cache.calibrator(TASK.name, "cpu", FitSettings(), phi_of(nominal_model(TASK.name))).offset
    assert offset is not None
    return np.float32([*(offset.matrix @ [truth.tcp_x, truth.tcp_y]), 0.0])


def _transition(before: np.ndarray, tool: np.ndarray, after: np.ndarray, number: int) -> Transition:
    way = tool[tool[:, 2] < 0.05].astype(np.float64)
    poses = np.concatenate([way, np.tile(TOOL_DOWN, (len(way), 1))], axis=1)
    executed = Executed(
        id=MessageId(f"executed-{number}"),
        time_s=1.0,
        approved_id=MessageId(f"approved-{number}"),
        outcome="completed",
        reason="",
        times_s=np.linspace(0, 1, len(way)),
        commanded=poses,
        measured=poses,
    )
    return Transition(id=MessageId(f"transition-{number}"), time_s=2.0, before=before, executed=executed, after=after)
