"""Specification of a physical parameter: name, unit, range, and the scale on which it is searched."""

from dataclasses import dataclass, replace
from math import exp, log
from typing import Final, Literal, Self, TypeAlias, final

_AT_END: Final = 1e-3

NullPrior: TypeAlias = tuple[float, float]
"""Mean and standard deviation, in typical values, of what a parameter seems to have where its effect is absent."""


@final
@dataclass(frozen=True, kw_only=True)
class ParameterSpec:
    """One entry of phi.

    `nominal` is the value of the nominal model; for a parameter of an effect it is the null value, at which the effect
    vanishes. `scale` says in which coordinate steps are even: "log" for positive quantities known to a factor.
    `about` is one sentence for people. `typical` is a value as it is met where the effect is present; what only says
    where or how an effect acts has none. `scaling`: see `real`. `null_prior`: discovery's, as the simulation is not the
    world even if no effect is missing in it; None: that of its family. `rod_null_prior`, `liquid_null_prior`: the same
    for ropes as rods, and for a liquid without pieces.
    """

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    scale: Literal["log", "linear"]
    about: str
    typical: float | None = None
    scaling: tuple[int, int] = (0, 0)
    null_prior: NullPrior | None = None
    rod_null_prior: NullPrior | None = None
    liquid_null_prior: NullPrior | None = None

    def __post_init__(self) -> None:
        if not self.low <= self.nominal <= self.high:
            raise ValueError(f"{self.name}: the nominal value {self.nominal:g} is outside {self.low:g}..{self.high:g}.")
        if self.scale == "log" and self.low <= 0:
            raise ValueError(f"{self.name}: a logarithmic scale needs a positive lower bound, not {self.low:g}.")
        if self.typical is not None and not self.low <= self.typical <= self.high:
            raise ValueError(f"{self.name}: the typical value {self.typical:g} is outside {self.low:g}..{self.high:g}.")

    def at_end(self, value: float) -> bool:
        """True if an estimated value is at an end of the range: within a thousandth of it."""
        low, here, high = (self.coordinate(each) for each in (self.low, value, self.high))
        return min(here - low, high - here) < _AT_END * (high - low)

    def coordinate(self, value: float) -> float:
        """`value` on the scale on which steps are even."""
        return log(value) if self.scale == "log" else value

    def value(self, coordinate: float) -> float:
        """The inverse of `coordinate`, within the range."""
        return min(max(exp(coordinate) if self.scale == "log" else coordinate, self.low), self.high)

    def real(self, value: float, time_scale: float, gravity_scale: float) -> float:
        """`value` as it is where time is not scaled, nor gravity.

        With (a, b) = `scaling`, it is value time_scale^a gravity_scale^b: what keeps the ratio of its force to
        friction, which a quasi-static motion depends on (dynamic similarity; Bridgman 1922, "Dimensional Analysis").
        """
        return value * time_scale ** self.scaling[0] * gravity_scale ** self.scaling[1]

    def in_real_units(self, time_scale: float, gravity_scale: float) -> Self:
        """The same parameter where nothing runs faster or weighs more: its nominal and typical values and its ends."""
        nominal, low, high = (
            self.real(value, time_scale, gravity_scale) for value in (self.nominal, self.low, self.high)
        )
        typical = None if self.typical is None else self.real(self.typical, time_scale, gravity_scale)
        return replace(self, nominal=nominal, low=low, high=high, typical=typical)
