"""Models extended by discovery: conversion of its estimates to a message, and checks that one is fit for use."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float64

from app.core.errors import ParameterError
from app.core.messages import Extension, Model, Parameter, fresh_id
from app.discovery import sensor_actuator_errors
from app.discovery.dataset.model_under_test import Catalogue, Theta, catalogue
from app.discovery.residuals.sensitivity import Step
from app.jobs.jit_cache import nominal_model
from app.sim.files import files_of
from app.sim.model.catalogue import discover as effects_of_the_simulator
from app.sim.model.numerics import ANY_NUMERICS
from app.sim.model.params import PARAMETERS, phi_with_nulls, require_ranges, validate
from app.sim.parameter import ParameterSpec
from app.tasks import load

_Z90 = 1.645


@final
class Covariance(NamedTuple):
    """Covariance of parameters' values, by their names, in products of their units."""

    names: tuple[str, ...]
    matrix: Float64[np.ndarray, "Q Q"]


def extended_model(
    task: str,
    values: Sequence[Parameter],
    *,
    effects: Sequence[str],
    covariance: Covariance,
    recordings: Mapping[str, str],
    camera_m: tuple[float, float, float],
    pushes: int,
    time_s: float,
) -> Model:
    """Version 1: the task's nominal model with `values`, parameters of the simulator, of cameras and of the arm.

    Parameters of cameras and arm at their null are left out, and so are those of our own numerics, which the planner's
    grid keeps as they are. `effects`, `recordings`, `camera_m`: see `Extension`; `pushes`: how many are behind it.

    Raises ParameterError for a parameter that nobody knows, or a value outside its range.
    """
    nominal, apparatus = nominal_model(task), _apparatus_specs()
    found = {parameter.name: parameter for parameter in values}
    _require_known("parameter", found, [*(spec.name for spec in PARAMETERS), *apparatus, *ANY_NUMERICS])
    model = Model(
        id=fresh_id("model"),
        cause=(nominal.id,),
        time_s=time_s,
        version=1,
        task=task,
        parameters=tuple(found.get(old.name, old) for old in nominal.parameters),
        transition_count=pushes,
        apparatus=tuple(found[name] for name, spec in apparatus.items() if _wrong(spec, found)),
        extension=Extension(
            effects=tuple(effects),
            camera_m=tuple(map(float, camera_m)),
            estimated=covariance.names,
            covariance=tuple(tuple(row) for row in np.asarray(covariance.matrix, np.float64).tolist()),
            recordings=dict(recordings),
        ),
    )
    check(model)
    return model


def fitted_parameters(
    known: Catalogue, nominal: Theta, theta: Theta, steps: Sequence[Step], covariance: Float64[np.ndarray, "Q Q"]
) -> tuple[tuple[Parameter, ...], Covariance]:
    """Parameters of a discovery's `theta`, of which `steps` with their covariance were fitted, in simulator's units.

    What is as in `nominal` and was not fitted is left out. On a logarithmic scale errors are taken to be small for the
    covariance, though not for the intervals.
    """
    fitted = {step.column: number for number, step in enumerate(steps)}
    scale = np.array([_slope(known.specs[step.column], theta[step.column]) * step.size for step in steps])
    values = list[Parameter]()
    for column, spec in enumerate(known.specs):
        if column in fitted:
            number = fitted[column]
            margin = _Z90 * float(np.sqrt(covariance[number, number])) * abs(steps[number].size)
            here = spec.coordinate(float(theta[column]))
            value, low, high = (spec.value(here + side * margin) for side in (0.0, -1.0, 1.0))
        elif theta[column] != nominal[column]:
            value = low = high = float(theta[column])
        else:
            continue
        values.append(Parameter(name=spec.name, unit=spec.unit, value=value, low=low, high=high))
    names = tuple(known.specs[step.column].name for step in steps)
    return tuple(values), Covariance(names, covariance * np.outer(scale, scale))


def check(model: Model) -> None:
    """Raises ParameterError where a parameter is missing, unknown, non-finite or outside its range.

    An effect that the model does not name is at its null.
    """
    values = {parameter.name: parameter.value for parameter in model.parameters}
    _require_known("parameter of the simulator", values, [spec.name for spec in PARAMETERS])
    own = load(model.task).parameters()
    validate(phi_with_nulls(values), own)
    specs = _apparatus_specs()
    _require_known("parameter of cameras and arm", [parameter.name for parameter in model.apparatus], specs)
    units = {spec.name: spec.unit for spec in (*own, *specs.values())}
    for parameter in (*model.parameters, *model.apparatus):
        if parameter.unit != (unit := units.get(parameter.name, parameter.unit)):
            raise ParameterError(
                f"The model gives {parameter.name} in {parameter.unit!r}, and it is read in {unit!r}; convert it."
            )
    _require_known("effect", model.extension.effects, _effect_names())
    for parameter in model.apparatus:
        require_ranges([specs[parameter.name]], np.array([[parameter.value]], np.float32))
    if model.apparatus and not (len(model.extension.camera_m) == 3 and np.isfinite(model.extension.camera_m).all()):
        raise ParameterError(
            "The model says what cameras and arm get wrong, but not where the cameras are; give their middle as "
            "camera_m = [x, y, z] in [extension], or let `dipac discover` write the file."
        )


def ends_of_ranges(model: Model) -> dict[str, str]:
    """In words, the estimates (those with an interval) at an end of their range, by the parameters' names."""
    specs = {spec.name: spec for spec in load(model.task).parameters()} | _apparatus_specs()
    found = dict[str, str]()
    for parameter in (*model.parameters, *model.apparatus):
        spec = specs[parameter.name]
        if parameter.low < parameter.high and spec.at_end(parameter.value):
            middle = (spec.coordinate(spec.low) + spec.coordinate(spec.high)) / 2
            which = "low" if spec.coordinate(parameter.value) < middle else "high"
            found[parameter.name] = f"at the {which} end of its range, {spec.low:g} to {spec.high:g} {spec.unit}"
    return found


def _slope(spec: ParameterSpec, value: float) -> float:
    """Derivative of the value with respect to its coordinate."""
    return float(value) if spec.scale == "log" else 1.0


def _effect_names() -> list[str]:
    """Every effect that a model may name, of whatever object: causes, our own numerics, and libraries of terms."""
    apparatus = (name for name, _ in files_of(sensor_actuator_errors))
    names = [*(cause.name for cause in catalogue().causes), *apparatus, *ANY_NUMERICS, *effects_of_the_simulator()]
    return list(dict.fromkeys(names))


def _apparatus_specs() -> dict[str, ParameterSpec]:
    return {spec.name: spec for effect, _ in catalogue().apparatus for spec in effect.parameters}


def _require_known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    listed = list(known)
    for name in names:
        if name not in listed:
            raise ParameterError.unknown(kind, name, listed)


def _wrong(spec: ParameterSpec, found: Mapping[str, Parameter]) -> bool:
    return spec.name in found and found[spec.name].value != spec.nominal
