"""Interface of an apparatus effect: a module-level `EFFECT`.

Three things can be wrong outside of the physics: the tool's true path (`drive`), the cameras' observation of the
scene (`see`, `late_s`), and how much there is of what no camera sees whole (`more`). These are plain functions of
arrays; the simulator is given the true tool path and content, and its predictions are observed through `see`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.track import Track
from app.sim.effects.base import EVERY, ObjectKind
from app.sim.parameter import NullPrior, ParameterSpec

Values: TypeAlias = Float64[np.ndarray, " V"]
"""Values of an effect's parameters, in their order."""
Places: TypeAlias = Float64[np.ndarray, "M 3"]


class Eye(NamedTuple):
    """Position of the cameras [m], and for each point the nearest one of the object's middle line [m], if known.

    To find these takes tens of milliseconds, so they may be a function, which is called where an effect asks.
    """

    position: Float64[np.ndarray, "3"]
    nearest: Places | Callable[[], Places] | None

    @property
    def middle(self) -> Places | None:
        """The nearest points; None if unknown."""
        return self.nearest() if callable(self.nearest) else self.nearest


class Load(NamedTuple):
    """The force [N] that the object puts up against the tool, against its motion, at the times of a track."""

    forces: Float64[np.ndarray, "T 3"]


Drive: TypeAlias = Callable[[Track, Load, Values], Track]
See: TypeAlias = Callable[[Places, Eye, Values], Places]


@final
@dataclass(frozen=True, kw_only=True)
class Apparatus:
    """An effect of sensing or of actuation, which vanishes where its parameters have their nominal (null) values.

    `drive(track, load, values)`: where the tip went, of where the record says it went; `see(points, eye, values)`:
    where the cameras say that points are; `late_s(values)`: by how much images are younger than their stamps say;
    `more(values)`: the share of a liquid's volume by which there is more of it than was said.
    `told`: whether the arm measures the effect itself, so that a measured track is free of it.
    `objects`, `spelling`: see `Effect`.
    """

    family: Literal["sensing", "actuation"]
    parameters: tuple[ParameterSpec, ...]
    drive: Drive | None = None
    see: See | None = None
    late_s: Callable[[Values], float] | None = None
    more: Callable[[Values], float] | None = None
    told: bool = False
    objects: frozenset[ObjectKind] = EVERY
    spelling: tuple[str, str] | None = None


def lengths(
    name: str, typical: float, most: float, about: str, *, null_prior: NullPrior | None = None
) -> tuple[ParameterSpec, ...]:
    """Three parameters, a vector [m]: `name`_x, `name`_y, `name`_z."""
    return tuple(
        ParameterSpec(
            name=f"{name}_{axis}",
            unit="m",
            nominal=0.0,
            low=-most,
            high=most,
            typical=typical,
            scale="linear",
            about=f"{about} along {axis}.",
            null_prior=null_prior,
        )
        for axis in "xyz"
    )


def one(
    name: str,
    unit: str,
    typical: float,
    most: float,
    about: str,
    *,
    least: float = 0.0,
    null_prior: NullPrior | None = None,
    liquid_null_prior: NullPrior | None = None,
) -> tuple[ParameterSpec, ...]:
    """A single parameter whose null is 0."""
    return (
        ParameterSpec(
            name=name,
            unit=unit,
            nominal=0.0,
            low=least,
            high=most,
            typical=typical,
            scale="linear",
            about=about,
            null_prior=null_prior,
            liquid_null_prior=liquid_null_prior,
        ),
    )
