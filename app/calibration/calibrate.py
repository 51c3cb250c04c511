"""The next version of a model from transitions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float32, Float64

from app.calibration.evidence import Evidence, ModelScorer
from app.calibration.fit import Fit, FitSettings, fit
from app.core.messages import Model, Parameter, Transition, fresh_id
from app.sim.model.params import PARAMETERS, ROD_PARAMETERS, index, phi_with_nulls
from app.sim.parameter import ParameterSpec


@final
@dataclass(frozen=True, kw_only=True)
class ToolOffset:
    """Unknown offset of the tool's tip, in coordinates t: x_tip = x + axes t [m].

    `specs`: of the coordinates t; `axes`: rows of the matrix that takes t to x and y.
    """

    specs: tuple[ParameterSpec, ...]
    axes: tuple[tuple[float, ...], tuple[float, ...]]

    @property
    def matrix(self) -> Float64[np.ndarray, "2 T"]:
        """The axes as an array."""
        return np.array(self.axes, np.float64)


@final
@dataclass(frozen=True, kw_only=True)
class Calibrator:
    """Estimator of the parameters of `specs`; the others keep the values of the model that it starts from.

    Their ranges are those of the predictor's simulator. `offset`: coordinates of the tool's offset to estimate besides
    (`fit_with_offset`).
    """

    predictor: ModelScorer
    specs: tuple[ParameterSpec, ...]
    settings: FitSettings
    offset: ToolOffset | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the estimated parameters, in the order of `specs`."""
        return tuple(spec.name for spec in self.specs)

    def fit_with_offset(self, evidence: Evidence, phi: Float32[np.ndarray, " P"]) -> Fit:
        """As `fit`, with the coordinates of the tool's offset after `names`, starting at zero."""
        assert self.offset is not None
        columns, matrix = [index(name) for name in self.names], self.offset.matrix

        def slopes(values: Float64[np.ndarray, " Q"]) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, "K Q"]]:
            trial, offset = phi.copy(), values[len(columns) :]
            trial[columns] = values[: len(columns)]
            shift_m = (matrix @ offset).astype(np.float32)
            losses, by_phi, by_shift = self.predictor.shifted_slopes(trial, shift_m, evidence)
            return losses.astype(np.float64), np.concatenate([by_phi[:, columns], by_shift @ matrix], axis=1)

        start = np.concatenate([phi[columns].astype(np.float64), np.zeros(len(self.offset.specs))])
        return fit(slopes, start, [*self.specs, *self.offset.specs], self.settings)

    def fit(self, evidence: Evidence, phi: Float32[np.ndarray, " P"]) -> Fit:
        """The parameters `names` that predict the evidence best, starting from `phi`."""
        columns = [index(name) for name in self.names]

        def slopes(values: Float64[np.ndarray, " Q"]) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, "K Q"]]:
            trial = phi.copy()
            trial[columns] = values
            losses, gradients = self.predictor.slopes(trial, evidence)
            return losses.astype(np.float64), gradients[:, columns].astype(np.float64)

        return fit(slopes, phi[columns].astype(np.float64), self.specs, self.settings)


def phi_of(model: Model) -> Float32[np.ndarray, " P"]:
    """The model's parameters in the simulator's order, clipped into their widest ranges against rounding errors."""
    values = phi_with_nulls({parameter.name: parameter.value for parameter in model.parameters})
    ends = [(spec.low, spec.high, rod.low, rod.high) for spec, rod in zip(PARAMETERS, ROD_PARAMETERS, strict=True)]
    return np.clip(values, np.min(ends, axis=1), np.max(ends, axis=1)).astype(np.float32)


def next_model(
    old: Model,
    found: Fit,
    names: Sequence[str],
    transitions: Sequence[Transition],
    offset: Sequence[ParameterSpec] = (),
) -> Model:
    """`old` with the fitted parameters; dated as the newest transition behind it.

    Its apparatus errors stay, except the tool's `offset`, whose coordinates follow `names` in `found` and are added to
    those of `old`. The provenance of an extended model stays.
    """
    estimates = {
        name: Parameter(
            name=name, unit=PARAMETERS[index(name)].unit, value=float(value), low=float(low), high=float(high)
        )
        for name, value, low, high in zip(names, found.values, found.low, found.high, strict=False)
    }
    known = {parameter.name: parameter for parameter in old.parameters}
    return replace(
        old,
        id=fresh_id("model"),
        cause=(old.id, *(transition.id for transition in transitions)),
        time_s=max(transition.time_s for transition in transitions),
        version=old.version + 1,
        parameters=tuple((known | estimates).values()),
        apparatus=_with_offset(old.apparatus, found, len(names), offset),
        loss_m2=found.loss_m2,
        transition_count=len(transitions),
    )


def _with_offset(
    known: tuple[Parameter, ...], found: Fit, first: int, specs: Sequence[ParameterSpec]
) -> tuple[Parameter, ...]:
    """Known apparatus parameters, with the coordinates of the tool's offset moved by the fit."""
    before = {parameter.name: parameter.value for parameter in known}
    moved = [parameter for parameter in known if parameter.name not in {spec.name for spec in specs}]
    for column, spec in enumerate(specs, first):
        was = before.get(spec.name, spec.nominal)
        value, low, high = (
            float(np.clip(was + ends[column], spec.low, spec.high)) for ends in (found.values, found.low, found.high)
        )
        moved.append(Parameter(name=spec.name, unit=spec.unit, value=value, low=low, high=high))
    return tuple(moved)
