"""A fit that is exact: what a decision or a formula is made of, without a simulation."""

from collections.abc import Mapping

import numpy as np

from app.discovery.dataset.model_under_test import Catalogue, Subject
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.refine import RefinedModel, own_steps
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.rows import Block, Residuals


def exact_model(
    subject: Subject, known: Catalogue, causes: tuple[str, ...], values: Mapping[str, float]
) -> RefinedModel:
    """A fit of these causes, at these values, to rows that say them in their own steps."""
    theta = known.nominal(subject)
    for name, value in values.items():
        theta[known.column(name)] = value
    steps = own_steps(known, subject.calibrated, causes)
    count = len(steps)
    rng = np.random.default_rng(0)
    data = Residuals(
        J=rng.normal(size=(20, 8, count)),
        r=1e-3 * rng.normal(size=(20, 8)),
        spread=np.zeros((20, 8, 1)),
        known=np.ones((20, 8), bool),
        episode=np.arange(20) // 4,
        blocks=(Block(slice(0, 8), 1e-3),),
    )
    prior = Prior(mean=np.zeros(count), variance=np.ones(count), nuisance=(0, 1))
    return RefinedModel(
        causes=causes,
        theta=theta,
        estimate=theta,
        steps=steps,
        own=count,
        data=data,
        prior=prior,
        fit=fit_mixed_effects(data, prior.variance),
        log_evidence=0.0,
        temperature=1.0,
    )
