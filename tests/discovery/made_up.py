"""A screening of four causes by residuals and slopes that are made up."""

from collections.abc import Callable

import numpy as np

from app.discovery.inference.screen import Screening
from app.discovery.inference.weighing import ModelComparison, Prior, weigh
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.residuals.sensitivity import Step

K, R = 60, 16
CAUSES = ("push", "tilt", "drag", "film")
ALL = [[1], [2], [3], [4]]


def screening(slopes: Callable[[np.random.Generator], np.ndarray]) -> Screening:
    """A world with friction and four causes; `slopes` are (K, R, 4) [mm a step] under noise of 1 mm."""
    rng = np.random.default_rng(0)
    J = 1e-3 * np.concatenate([rng.normal(size=(K, R, 1)), slopes(rng)], axis=2)
    data = Residuals(
        r=1e-3 * rng.normal(size=(K, R)),
        J=J,
        spread=np.zeros((K, R, 1)),
        known=np.ones((K, R), bool),
        episode=np.arange(K) // 6,
        blocks=(Block(slice(0, R)),),
    )
    prior = Prior(mean=np.zeros(5), variance=np.array([100.0, *[0.05**2] * 4]), nuisance=(0,))
    steps = [Step(cause=name, column=n, size=1.0, sides=2) for n, name in enumerate(("friction", *CAUSES))]
    weighing: ModelComparison = weigh(data, ALL, prior)
    return Screening(
        about=np.zeros(5), steps=tuple(steps), data=data, prior=prior, weighing=weighing, suspects=(), ends={}
    )
