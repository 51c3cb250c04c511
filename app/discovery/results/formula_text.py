"""A formula as people read it: its terms in symbols, and in words where a template matches.

Forces are shares of weight, f / (m g), as the simulator has them; words give accelerations where those are what one
would measure.
"""

from collections.abc import Mapping
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float64

from app.discovery.dataset.model_under_test import Subject
from app.discovery.residuals.forces import FEATURES, FORMULA, parameters
from app.discovery.results.case import Estimate, Formula, Term
from app.discovery.results.verdict import estimates_of
from app.discovery.unexplained.formula import AcceptedFormula
from app.sim.effects.base import MIDDLE_M

_G = 9.81
_PLACE = ("push_x", "push_y", "spread", "swirl", "stretch_axes", "stretch_diagonals")
_FARTHEST_M = 0.6
"""Distance from the middle of the workspace beyond which a point is not reported: the table is narrower."""
_DRAWS = 1000


@final
class _Said(NamedTuple):
    formula: str
    words: str


def formula_of(subject: Subject, found: AcceptedFormula) -> Formula:
    """The formula with the values that its model has."""
    estimates = {it.name: it for it in estimates_of(found.catalogue, subject, found.model, FORMULA)}
    values = {name: it.value for name, it in estimates.items()}
    terms = list[Term]()
    if any(name in values for name in _PLACE):
        own = tuple(estimates[name] for name in _PLACE if name in estimates)
        about_m = np.array(MIDDLE_M) + found.catalogue.origin_m
        middle = _middle(values, about_m)
        said = _place(values, middle, about_m)
        terms.append(Term(formula=said.formula, words=said.words, estimates=(*own, *_about(found, middle))))
    for feature in (feature for feature in found.features if feature in _MOVING):
        said = _MOVING[feature](*(values[name] for name in FEATURES[feature]))
        own = tuple(estimates[name] for name in parameters([feature]))
        terms.append(Term(formula=said.formula, words=said.words, estimates=own))
    text = "f / (m g) = " + " + ".join(term.formula for term in terms).replace("+ -", "- ")
    words = "; ".join(term.words for term in terms)
    return Formula(text=text, words=f"{words[0].upper()}{words[1:]}.", terms=tuple(terms))


def _place(
    values: Mapping[str, float], middle: Float64[np.ndarray, "2"] | None, about_m: Float64[np.ndarray, "2"]
) -> _Said:
    """A push, or what spreads, swirls and stretches about a point."""
    push = np.array([values["push_x"], values["push_y"]])
    linear = {name: values[name] for name in _PLACE[2:] if name in values}
    if not linear:
        return _Said(_vector(push), f"a push {_heading(push)}")
    if middle is None:
        said = _symbols(linear, f"(x - ({about_m[0]:g}, {about_m[1]:g}) m)")
        return _Said(f"{_vector(push)} + {said}", "a push that changes with place, about no point of the table")
    where = f"({middle[0]:.2f}, {middle[1]:.2f}) m"
    parts = list[str]()
    if "swirl" in linear:
        way = "counter-clockwise" if linear["swirl"] > 0 else "clockwise"
        parts.append(f"swirls about {where}, {way}, {_rate(linear['swirl'])}")
    if "spread" in linear:
        way = "pushes away from" if linear["spread"] > 0 else "pulls towards"
        parts.append(f"{way} {where} in proportion to the distance, {_rate(linear['spread'])}")
    if "stretch_axes" in linear:
        a, b = linear["stretch_axes"], linear["stretch_diagonals"]
        along = np.degrees(np.arctan2(b, a)) / 2
        parts.append(
            f"pushes outwards from {where} at {along:.0f} degrees from x and inwards across that, "
            f"{_rate(float(np.hypot(a, b)))}"
        )
    return _Said(_symbols(linear, f"(x - {where})"), f"a force that {' and '.join(parts)}")


def _symbols(linear: Mapping[str, float], away: str) -> str:
    """The linear part; n points up."""
    symbols = {"spread": away, "swirl": f"n x {away}", "stretch_axes": f"A {away}", "stretch_diagonals": f"B {away}"}
    return " + ".join(f"{value:.3g}/m {symbols[name]}" for name, value in linear.items())


def _matrix(values: Mapping[str, float]) -> Float64[np.ndarray, "2 2"]:
    """Matrix of the linear part [1/m]; see `place_force`."""
    r, s, a, b = (values.get(name, 0.0) for name in _PLACE[2:])
    return np.array([[r + a, b - s], [b + s, r - a]])


def _middle(values: Mapping[str, float], about_m: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "2"] | None:
    """The point [m] at which a force of place about `about_m` vanishes, if that is on the table."""
    A = _matrix(values)
    if abs(np.linalg.det(A)) < 1e-9:
        return None
    away = -np.linalg.solve(A, np.array([values["push_x"], values["push_y"]]))
    return away + about_m if np.linalg.norm(away) < _FARTHEST_M else None


def _about(found: AcceptedFormula, middle: Float64[np.ndarray, "2"] | None) -> tuple[Estimate, ...]:
    """Coordinates of that point, with the interval by the parameters' covariance."""
    if middle is None:
        return ()
    model = found.model
    steps = model.steps[: model.own]
    names = [found.catalogue.specs[step.column].name for step in steps]
    here = np.array([model.estimate[step.column] for step in steps])
    drawn = np.random.default_rng(0).multivariate_normal(np.zeros(len(steps)), model.covariance, _DRAWS)
    rows = here + drawn * np.array([step.size for step in steps])
    about_m = np.array(MIDDLE_M) + found.catalogue.origin_m
    points = [_middle(dict(zip(names, row.tolist(), strict=True)), about_m) for row in rows]
    low, high = np.quantile([point for point in points if point is not None], [0.05, 0.95], axis=0)
    return tuple(
        Estimate(
            name=f"about_{axis}",
            about=f"Where the force vanishes, along {axis}.",
            value=float(middle[n]),
            unit="m",
            low=float(low[n]),
            high=float(high[n]),
            null=float("nan"),
        )
        for n, axis in enumerate("xy")
    )


def _drag(rate: float) -> _Said:
    kind = "drag" if rate > 0 else "a drive"
    return _Said(f"{-rate / _G:.3g} s/m v", f"{kind} in proportion to speed, {abs(rate):.2g} 1/s")


def _drag_squared(rate: float) -> _Said:
    kind = "drag" if rate > 0 else "a drive"
    return _Said(f"{-rate / _G:.3g} s^2/m^2 |v| v", f"{kind} that grows with the square of speed, {abs(rate):.2g} 1/m")


def _sideways(share: float) -> _Said:
    words = f"a pull to the {_side(share)} of the way by {abs(share):.0%} of the weight, whatever the speed"
    return _Said(f"{share:.3g} n x v/|v|", words)


def _sideways_rate(rate: float) -> _Said:
    words = f"a pull to the {_side(rate)} of the way in proportion to speed, {abs(rate):.2g} 1/s"
    return _Said(f"{rate / _G:.3g} s/m n x v", words)


def _growth(x: float, y: float) -> _Said:
    growth = np.array([x, y])
    return _Said(f"t {_vector(growth)}", f"in the course of the session a further push {_heading(growth)}")


_MOVING = {
    "drag": _drag,
    "drag_squared": _drag_squared,
    "sideways": _sideways,
    "sideways_rate": _sideways_rate,
    "growth": _growth,
}
"""Texts of features that do not depend on place, in symbols and words, by their real parameters."""


def _side(value: float) -> str:
    return "left" if value > 0 else "right"


def _rate(share: float) -> str:
    """A share of weight a metre as an acceleration a metre."""
    return f"{_G * abs(share):.2g} 1/s^2"


def _vector(share: Float64[np.ndarray, "2"]) -> str:
    return f"({share[0]:.3g}, {share[1]:.3g})"


def _heading(share: Float64[np.ndarray, "2"]) -> str:
    heading = np.degrees(np.arctan2(share[1], share[0]))
    return f"by {np.linalg.norm(share):.0%} of the weight, {heading:.0f} degrees from x"
