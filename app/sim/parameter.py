"""What a physical parameter is: its name, unit, range, and the scale on which it is searched."""

from dataclasses import dataclass
from typing import Literal, final


@final
@dataclass(frozen=True, kw_only=True)
class ParameterSpec:
    """One entry of phi.

    `nominal` is the value of the nominal model; for a parameter of an effect it is the null value, at which the effect
    vanishes. `scale` says in which coordinate steps are even: "log" for positive quantities known to a factor.
    `about` is one sentence for people.
    """

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    scale: Literal["log", "linear"]
    about: str

    def __post_init__(self) -> None:
        if not self.low <= self.nominal <= self.high:
            raise ValueError(f"{self.name}: the nominal value {self.nominal:g} is outside {self.low:g}..{self.high:g}.")
        if self.scale == "log" and self.low <= 0:
            raise ValueError(f"{self.name}: a logarithmic scale needs a positive lower bound, not {self.low:g}.")
