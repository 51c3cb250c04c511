"""Validity of parameters and scenes, and the errors for those that are not valid."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.core.errors import ParameterError
from app.sim.model.params import PARAMETERS, index, nominal_phi, validate, with_stiffness_up_to
from app.sim.parameter import ParameterSpec
from tests.sim.scenes import SCENE


def test_the_nominal_parameters_are_valid_and_in_the_order_of_the_table():
    assert validate(nominal_phi()) == pytest.approx([spec.nominal for spec in PARAMETERS])
    assert all(index(spec.name) == column for column, spec in enumerate(PARAMETERS))


@pytest.mark.parametrize("spec", PARAMETERS, ids=lambda spec: spec.name)
@pytest.mark.parametrize("value", [np.nan, np.inf, -1e9, 1e9])
def test_a_value_outside_its_range_is_named_with_the_range(spec: ParameterSpec, value: float):
    phi = np.tile(nominal_phi(), (3, 1))
    phi[1, index(spec.name)] = value
    told = rf"{spec.name} = \S+ is outside its range {re.escape(f'{spec.low:g} to {spec.high:g}')}"
    with pytest.raises(ParameterError, match=told):
        validate(phi)


def test_both_ends_of_a_range_belong_to_it():
    validate(np.array([[spec.low for spec in PARAMETERS], [spec.high for spec in PARAMETERS]], np.float32))


def test_stiffness_ends_where_a_simulators_time_steps_do():
    limits = {spec.name: spec.high for spec in with_stiffness_up_to(PARAMETERS, 7e4)}
    assert limits == {spec.name: spec.high for spec in PARAMETERS} | {"stiffness": 7e4}
    phi = nominal_phi()
    phi[index("stiffness")] = 8e4
    validate(phi)
    with pytest.raises(ParameterError, match="1000 to 70000"):
        validate(phi, with_stiffness_up_to(PARAMETERS, 7e4))


def test_an_unknown_parameter_names_the_likeliest():
    with pytest.raises(ParameterError, match="Did you mean 'stiffness'"):
        index("stifness")


def test_the_wrong_number_of_columns_is_said():
    with pytest.raises(ParameterError, match="last axis"):
        validate(nominal_phi()[:-1])


def test_a_specification_that_contradicts_itself_is_refused():
    spec = PARAMETERS[0]
    with pytest.raises(ValueError, match="outside"):
        replace(spec, nominal=spec.high * 2)
    with pytest.raises(ValueError, match="logarithmic"):
        replace(spec, low=0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dt_s": 1e-2}, "above the stable limit"),
        ({"cell_m": 0.0025}, "above the stable limit"),
        ({"dt_s": float("nan")}, "dt_s = nan is not finite"),
        ({"low": (0.2, float("inf"), -0.025)}, "low = .* is not finite"),
        ({"high": (0.15, 0.45, 0.10)}, "4 nodes"),
        ({"low": (0.15, -0.45, -0.015)}, "whole number of cells"),
        ({"low": (0.15, -0.45, 0.0)}, "whole number of cells"),
        ({"bodies": ()}, "at least one body"),
        ({"damping_1_s": -1.0}, "damping_1_s"),
        ({"contact_substeps": 0.0}, "contact_substeps"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_in_words(change: dict[str, object], message: str):
    with pytest.raises(ParameterError, match=message):
        replace(SCENE, **change)


def test_the_stable_limit_itself_is_allowed_and_scales_with_the_cell():
    scene = SCENE
    replace(scene, dt_s=scene.stable_dt_s * 0.999)
    fine = replace(scene, cell_m=0.005, dt_s=1e-4)
    assert fine.stable_dt_s == pytest.approx(scene.stable_dt_s / 2)
