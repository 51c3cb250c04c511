"""A library of force features for what no cause of the catalogue explains, as further columns of the same inference.

Sparse regression over simulated sensitivities: the simulator is the test function, so that no velocity or acceleration
of unordered points has to be estimated (the weak form of Messenger and Bortz 2021, "Weak SINDy", with trajectories in
place of bumps). The features' parameters are those of the effects that are not catalogued.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float64

from app.discovery.evidence import Residuals
from app.discovery.inference import Prior, Weighing, habit, weigh
from app.discovery.predict import Predictor, Trials
from app.discovery.refine import Model
from app.discovery.screen import Screening
from app.discovery.sensitivity import Step, residuals, switch_of
from app.discovery.subject import Catalogue, Cause

FORMULA = "formula"
"""The name that all features together go by where a cause has one."""
_PUSH = ("push_x", "push_y")
FEATURES: Mapping[str, tuple[str, ...]] = {
    "push": _PUSH,
    "spread": ("spread", *_PUSH),
    "swirl": ("swirl", *_PUSH),
    "stretch": ("stretch_axes", "stretch_diagonals", *_PUSH),
    "drag": ("drag",),
    "drag_squared": ("drag_squared",),
    "sideways": ("sideways",),
    "sideways_rate": ("sideways_rate",),
    "growth": ("growth_x", "growth_y"),
}
"""Parameters of each feature: what is about a point of the table needs the push that says which."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Widened:
    """The inference about a model with the features as its last columns.

    `at`: the columns of each feature; `weighing`: the model without any of them, and each of them against it.
    """

    data: Residuals
    prior: Prior
    weighing: Weighing
    at: Mapping[str, tuple[int, ...]]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Library:
    """Slopes (K, R, F) of every parameter of the features about the refitted nominal model, in `steps`."""

    steps: tuple[Step, ...]
    J: Float64[np.ndarray, "K R F"]
    deviation: float
    """What each seems to be where nothing is wrong, in steps."""

    def beside_nothing(self, screening: Screening) -> Widened:
        """The features against the refitted nominal model."""
        return self._beside(screening.data, screening.prior)

    def beside(self, model: Model) -> Widened:
        """The features against a model with causes of the catalogue."""
        return self._beside(model.data, model.prior)

    def screening(self, screening: Screening, wide: Widened) -> Screening:
        """The screening with the features' columns, for a refit of what consists of them."""
        return replace(
            screening, steps=(*screening.steps, *self.steps), data=wide.data, prior=wide.prior, weighing=wide.weighing
        )

    def _beside(self, data: Residuals, prior: Prior) -> Widened:
        first, count = data.J.shape[2], len(self.steps)
        wide = replace(data, J=np.concatenate([data.J, self.J], axis=2))
        prior = replace(
            prior,
            mean=np.concatenate([prior.mean, np.zeros(count)]),
            variance=np.concatenate([prior.variance, np.full(count, self.deviation**2)]),
        )
        names = parameters()
        at = {feature: tuple(first + names.index(name) for name in own) for feature, own in FEATURES.items()}
        return Widened(data=wide, prior=prior, weighing=weigh(wide, list(at.values()), prior), at=at)


def parameters(features: Sequence[str] = tuple(FEATURES)) -> list[str]:
    """Of these features, each once."""
    return list(dict.fromkeys(name for feature in features for name in FEATURES[feature]))


def with_formula(catalogue: Catalogue, features: Sequence[str] = tuple(FEATURES)) -> Catalogue:
    """The catalogue with one more cause: these features together."""
    columns = tuple(catalogue.column(name) for name in parameters(features))
    cause = Cause(
        name=FORMULA, family="physics", about="A force of no known cause.", columns=columns, switches=len(columns)
    )
    return replace(catalogue, causes=(*catalogue.causes, cause))


def library(predictor: Predictor, trials: Trials, screening: Screening) -> Library:
    """Simulate every feature at its typical size, both ways."""
    catalogue = with_formula(predictor.catalogue)
    cause = catalogue.cause(FORMULA)
    steps = tuple(switch_of(catalogue, cause, column) for column in cause.columns)
    sloped = residuals(Predictor(predictor.subject, catalogue), trials, screening.about, steps, replicas=0)
    return Library(steps=steps, J=sloped.J, deviation=habit(cause)[1])
