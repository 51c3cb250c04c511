"""Forces of no cause of the catalogue: features of a library that are rivals of every known cause.

Their parameters are those of the effects that are not catalogued. What looks like a tilt, and is a swirl, is named
neither: it is of no known cause, until `formula` says which force it is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from app.discovery.dataset.model_under_test import Catalogue, Cause
from app.discovery.residuals.sensitivity import Step, switch_of
from app.sim.model.params import index

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
"""Parameters of each feature: those about a point of the table need the push, which locates it."""


def parameters(features: Sequence[str] = tuple(FEATURES)) -> list[str]:
    """Parameters of these features, each once."""
    return list(dict.fromkeys(name for feature in features for name in FEATURES[feature]))


def with_formula(catalogue: Catalogue, features: Sequence[str] = tuple(FEATURES)) -> Catalogue:
    """The catalogue with one more cause: these features together."""
    columns = tuple(catalogue.column(name) for name in parameters(features))
    cause = Cause(
        name=FORMULA, family="physics", about="A force of no known cause.", columns=columns, switches=len(columns)
    )
    return replace(catalogue, causes=(*catalogue.causes, cause))


def force_steps(catalogue: Catalogue) -> tuple[Step, ...]:
    """A step of each feature's parameters from nothing to its typical size."""
    known = with_formula(catalogue)
    cause = known.cause(FORMULA)
    return tuple(switch_of(known, cause, column) for column in cause.columns)


def columns_of_features(steps: Sequence[Step]) -> Mapping[str, tuple[int, ...]]:
    """Positions of each feature's parameters among these steps; empty if the steps have none of them."""
    at = {step.column: n for n, step in enumerate(steps) if step.cause == FORMULA}
    if not at:
        return {}
    return {feature: tuple(at[index(name)] for name in own) for feature, own in FEATURES.items()}
