"""The next version of a model from transitions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float32, Float64

from app.calibration.evidence import Evidence, Predictor
from app.calibration.fit import Fit, Settings, fit
from app.core.messages import Model, Parameter, Transition, fresh_id
from app.sim.params import PARAMETERS, index


@final
@dataclass(frozen=True, kw_only=True)
class Calibrator:
    """Estimates the parameters called `names`; the others keep the values of the model that it starts from."""

    predictor: Predictor
    names: tuple[str, ...]
    settings: Settings

    def fit(self, evidence: Evidence, phi: Float32[np.ndarray, " P"]) -> Fit:
        """The parameters `names` that predict the evidence best, starting from `phi`."""
        columns = [index(name) for name in self.names]

        def slopes(values: Float64[np.ndarray, " Q"]) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, "K Q"]]:
            trial = phi.copy()
            trial[columns] = values
            losses, gradients = self.predictor.slopes(trial, evidence)
            return losses.astype(np.float64), gradients[:, columns].astype(np.float64)

        return fit(slopes, phi[columns].astype(np.float64), [PARAMETERS[column] for column in columns], self.settings)


def phi_of(model: Model) -> Float32[np.ndarray, " P"]:
    """The model's parameters in the simulator's order, clipped by a rounding error into their ranges."""
    values = np.array([model.value(spec.name) for spec in PARAMETERS], np.float32)
    return np.clip(values, [spec.low for spec in PARAMETERS], [spec.high for spec in PARAMETERS]).astype(np.float32)


def next_model(old: Model, found: Fit, names: Sequence[str], transitions: Sequence[Transition]) -> Model:
    """`old` with the fitted parameters; dated as the newest transition behind it.

    What cameras and arm get wrong stays, and so does where an extended model is from.
    """
    estimates = {
        name: (float(value), float(low), float(high))
        for name, value, low, high in zip(names, found.values, found.low, found.high, strict=True)
    }
    parameters = tuple(
        parameter
        if parameter.name not in estimates
        else Parameter(
            name=parameter.name,
            unit=parameter.unit,
            value=estimates[parameter.name][0],
            low=estimates[parameter.name][1],
            high=estimates[parameter.name][2],
        )
        for parameter in old.parameters
    )
    return replace(
        old,
        id=fresh_id("model"),
        cause=(old.id, *(transition.id for transition in transitions)),
        time_s=max(transition.time_s for transition in transitions),
        version=old.version + 1,
        parameters=parameters,
        loss_m2=found.loss_m2,
        transition_count=len(transitions),
    )
