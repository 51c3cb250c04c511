"""Models that discovery extended: made of its estimates, written, read, and refused where they cannot be used."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.calibration.calibrate import phi_of
from app.core.errors import ParameterError
from app.core.messages import Extension, Model, Parameter
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.residuals.sensitivity import Step
from app.jobs import jit_cache
from app.jobs.apparatus_compensation import correction
from app.jobs.discovery_subject import subject_of
from app.jobs.extended import Covariance, extended_model, fitted_parameters
from app.jobs.worker_api import check_model, nominal_model
from app.recording.exchange.model_file import load_model, save_model
from app.sim.model.params import PARAMETERS, acting, index
from app.tasks import load


def parameter(name: str, value: float, low: float, high: float, unit: str = "m") -> Parameter:
    return Parameter(name=name, value=value, unit=unit, low=low, high=high)


FOUND = (
    parameter("stiffness", 5.0e4, 4.0e4, 6.0e4, "Pa"),
    parameter("tilt_x", 1.5, 1.0, 2.0, "deg"),
    parameter("hand_eye_x", 0.004, 0.003, 0.005),
    parameter("hand_eye_y", 0.0, 0.0, 0.0),
    parameter("resolution", 0.3, 0.1, 0.5, "1"),
)
ESTIMATED = Covariance(("stiffness", "tilt_x", "hand_eye_x"), np.diag([4e7, 0.09, 4e-7]))


def made(**changes: Any) -> Model:
    given: dict[str, Any] = {
        "effects": ("table_tilt", "hand_eye_translation"),
        "covariance": ESTIMATED,
        "recordings": {"episode-01.mcap": "ab" * 32},
        "camera_m": (0.55, -0.25, 0.95),
        "pushes": 24,
        "time_s": 1.0,
    }
    return extended_model("rope_push", **({"values": FOUND} | given | changes))


def test_what_was_found_stands_beside_what_is_nominal() -> None:
    model, nominal = made(), nominal_model("rope_push")
    assert (model.version, model.cause, model.transition_count) == (1, (nominal.id,), 24)
    changed = [new.name for new, old in zip(model.parameters, nominal.parameters, strict=True) if new != old]
    assert changed == ["stiffness", "tilt_x"]
    assert [parameter.unit for parameter in model.parameters] == [spec.unit for spec in PARAMETERS]


def test_of_cameras_and_arm_only_what_is_wrong_is_kept_and_of_numerics_nothing() -> None:
    (kept,) = made().apparatus
    assert (kept.name, kept.value, kept.unit, kept.high) == ("hand_eye_x", 0.004, "m", 0.005)


def test_the_simulator_runs_with_the_effects_that_the_model_has() -> None:
    phi = phi_of(made())
    assert phi[index("tilt_x")] == pytest.approx(1.5)
    names = {effect.parameters[0].name for effect in acting(phi)}
    assert names == {effect.parameters[0].name for effect in acting(phi_of(nominal_model("rope_push")))} | {"tilt_x"}


def test_what_a_discovery_fitted_becomes_values_with_intervals_and_their_covariance() -> None:
    known, subject = catalogue(), subject_of(load("rope_push"))
    nominal = known.nominal(subject)
    theta = nominal.copy()
    stiffness, shift, friction = (known.column(name) for name in ("stiffness", "hand_eye_x", "table_friction"))
    theta[[stiffness, shift, friction]] = 5.0e4, 0.004, 0.6
    steps = [Step(cause="", column=column, size=size, sides=2) for column, size in ((stiffness, 0.1), (shift, 1e-3))]
    values, covariance = fitted_parameters(known, nominal, theta, steps, np.array([[4.0, 0.5], [0.5, 0.25]]))
    intervals = {each.name: (each.value, each.low, each.high) for each in values}
    assert intervals.keys() == {"stiffness", "hand_eye_x", "table_friction"}
    assert intervals["hand_eye_x"] == pytest.approx((0.004, 0.004 - 1.645 * 5e-4, 0.004 + 1.645 * 5e-4))
    assert intervals["stiffness"] == pytest.approx((5.0e4, 5.0e4 * np.exp(-0.329), 5.0e4 * np.exp(0.329)))
    assert intervals["table_friction"] == (0.6, 0.6, 0.6)
    assert [each.unit for each in values] == [known.specs[known.column(each.name)].unit for each in values]
    # A logarithm off by 0.2 and a shift off by half a millimetre, half as correlated as they could be.
    np.testing.assert_allclose(covariance.matrix, [[1e8, 2.5], [2.5, 2.5e-7]])
    model = made(values=values, covariance=covariance)
    np.testing.assert_allclose(correction(model).theta[shift], 0.004)


def test_a_model_goes_through_its_file_unchanged(tmp_path: Path) -> None:
    model = made()
    save_model(tmp_path / "model.toml", model)
    read = load_model(tmp_path / "model.toml", task="rope_push", time_s=2.0)
    check_model(read)
    assert read.parameters == model.parameters
    assert read.apparatus == model.apparatus
    assert read.extension == model.extension
    np.testing.assert_array_equal(correction(read).theta, correction(model).theta)


def test_a_parameter_that_nobody_knows_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ParameterError, match=r"Unknown parameter 'tilt_z'\. Did you mean 'tilt_[xy]'.*hand_eye_x"):
        made(values=[parameter("tilt_z", 1.0, 0.0, 2.0, "deg")])
    model = made()
    odd = replace(model, apparatus=(replace(model.apparatus[0], name="hand_aye_x"),))
    with pytest.raises(ParameterError, match=r"of cameras and arm 'hand_aye_x'\. Did you mean 'hand_eye_x'"):
        check_model(odd)
    odd = replace(model, parameters=(*model.parameters, model.apparatus[0]))
    with pytest.raises(ParameterError, match="Unknown parameter of the simulator 'hand_eye_x'"):
        check_model(odd)


@pytest.mark.parametrize("value", [0.5, float("nan")])
def test_an_error_of_cameras_or_arm_outside_of_its_range_is_refused(value: float) -> None:
    with pytest.raises(ParameterError, match="hand_eye_x"):
        made(values=[parameter("hand_eye_x", value, 0.0, 1.0)])


def test_errors_of_cameras_need_the_cameras_place() -> None:
    with pytest.raises(ParameterError, match=r"camera_m = \[x, y, z\]"):
        check_model(replace(made(), extension=Extension()))


def test_effects_that_a_model_is_older_than_are_at_their_null() -> None:
    whole = nominal_model("rope_push@rods")
    old = replace(whole, parameters=tuple(each for each in whole.parameters if each.name != "permanent_set"))
    check_model(old)
    assert np.array_equal(jit_cache.phi_of(old), jit_cache.phi_of(whole))


def test_a_model_that_lacks_a_parameter_of_the_simulator_is_refused() -> None:
    with pytest.raises(ParameterError, match="lacks stiffness; calibrate"):
        check_model(replace(made(), parameters=made().parameters[1:]))


def test_a_stiffness_that_rods_bear_is_refused_for_material_points() -> None:
    def stiff(task: str) -> Model:
        known = nominal_model(task)
        return replace(known, parameters=(replace(known.parameters[0], value=2e5), *known.parameters[1:]))

    check_model(stiff("rope_push@rods"))
    with pytest.raises(ParameterError, match="stiffness = 200000 is outside its range 1000 to 100000"):
        check_model(stiff("rope_push"))
