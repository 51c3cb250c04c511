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

from app.discovery.inference.refine import RefinedModel
from app.discovery.inference.screen import Screening
from app.discovery.inference.weighing import NULL_PRIOR_SD, ModelComparison, Prior, weigh
from app.discovery.residuals.forces import FORMULA, columns_of_features, force_steps, with_formula
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step, residuals
from app.discovery.residuals.simulation_batch import SimulationBatch


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Widened:
    """The inference about a model with the features as its last columns.

    `at`: the columns of each feature; `weighing`: the model without any of them, and each of them against it.
    """

    data: Residuals
    prior: Prior
    weighing: ModelComparison
    at: Mapping[str, tuple[int, ...]]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BasisFunctions:
    """Slopes (K, R, F) of the features' parameters about the refitted nominal model, in `steps`.

    Both are empty where the screening has them already, as it has of rods.
    """

    steps: tuple[Step, ...]
    J: Float64[np.ndarray, "K R F"]

    def beside_nothing(self, screening: Screening) -> Widened:
        """The features against the refitted nominal model."""
        return self._beside(screening.data, screening.prior, screening.steps)

    def beside(self, model: RefinedModel) -> Widened:
        """The features against a model with causes of the catalogue."""
        return self._beside(model.data, model.prior, model.steps)

    def screening(self, screening: Screening, wide: Widened) -> Screening:
        """The screening with the features' columns, for a refit of what consists of them."""
        return replace(
            screening, steps=(*screening.steps, *self.steps), data=wide.data, prior=wide.prior, weighing=wide.weighing
        )

    def _beside(self, data: Residuals, prior: Prior, steps: Sequence[Step]) -> Widened:
        count = len(self.steps)
        wide = replace(data, J=np.concatenate([data.J, self.J], axis=2))
        prior = replace(
            prior,
            mean=np.concatenate([prior.mean, np.zeros(count)]),
            variance=np.concatenate([prior.variance, np.full(count, NULL_PRIOR_SD["physics"] ** 2)]),
        )
        at = columns_of_features((*steps, *self.steps))
        return Widened(data=wide, prior=prior, weighing=weigh(wide, list(at.values()), prior), at=at)


def library(predictor: Predictor, trials: SimulationBatch, screening: Screening) -> BasisFunctions:
    """Simulate every feature at its typical size, both ways, where the screening has not."""
    if any(step.cause == FORMULA for step in screening.steps):
        return BasisFunctions(steps=(), J=np.zeros((*screening.data.r.shape, 0)))
    catalogue, steps = with_formula(predictor.catalogue), force_steps(predictor.catalogue)
    sloped = residuals(Predictor(predictor.subject, catalogue), trials, screening.about, steps, replicas=0)
    return BasisFunctions(steps=steps, J=sloped.J)
