"""Interface of an effect file: a module-level `EFFECT`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, TypeVar, cast, final

import warp as wp

from app.sim.parameter import NullPrior, ParameterSpec
from app.sim.rods.effect import RodEffect

WarpFunction: TypeAlias = Callable[..., Any]
ObjectKind: TypeAlias = Literal["rope", "grains", "cloth", "liquid", "soup"]
"""Kind of object that an error may be asked about: by what it has, a length, pieces, threads, a level, or a level and
pieces."""
EVERY: frozenset[ObjectKind] = frozenset({"rope", "grains", "cloth", "liquid", "soup"})
NOT_CLOTH: frozenset[ObjectKind] = EVERY - {"cloth"}
ROPES: frozenset[ObjectKind] = frozenset({"rope"})
GRAINS: frozenset[ObjectKind] = frozenset({"grains"})
LIQUIDS: frozenset[ObjectKind] = frozenset({"liquid", "soup"})
SOUPS: frozenset[ObjectKind] = frozenset({"soup"})
ON_TABLES: frozenset[ObjectKind] = frozenset({"rope", "grains"})
SOLIDS: frozenset[ObjectKind] = EVERY - LIQUIDS
"""Kinds that lie on the table or hang: what acts on the table, or at a place, does nothing to a liquid in bowls."""
ClassT = TypeVar("ClassT")


def _struct(fields: type[ClassT]) -> type[ClassT]:
    """A Warp struct, which stays a class for those who check types."""
    return cast("type[ClassT]", wp.struct(fields))


@_struct
class NodeContext:
    """A grid node as effects see it. `touched` is the share of its mass that a tool touches, `time` the session's.

    `gravity` is the scene's [m/s^2]. In `node_velocity`, v and touched are 0. `every`: see
    `app.sim.effect_composition`.
    """

    x: wp.vec3
    v: wp.vec3
    touched: float
    dt: float
    gravity: float
    time: float
    every: int


@_struct
class ParticleContext:
    """A particle as effects see it; see `state.Setting` for `label` and `time`.

    `fluid` is 1 for liquids, else 0, and told to hooks on stiffness, mass and viscosity; `shear` the square of its
    shear rate [1/s^2]; `stress` the norm of its deviatoric stress [Pa]. What a hook is not about is 0.
    """

    label: wp.vec4
    time: float
    dt: float
    fluid: float
    shear: float
    stress: float
    every: int


MIDDLE_M = (0.55, 0.0)
"""The middle of the tasks' table [m], about which fields of place are: a study elsewhere is moved there."""
MIDDLE = f"({MIDDLE_M[0]:g}, {MIDDLE_M[1]:g}) m"
"""The same in words, as `about` of a parameter has it."""
REACH_M = (0.40, 0.45)
"""Farthest from there along x and y that something may have its place, unless a study reaches farther."""


def place(name: str, what: str) -> tuple[ParameterSpec, ...]:
    """Two parameters, `name`_x and `name`_y: where something is in the workspace."""
    return tuple(
        ParameterSpec(
            name=f"{name}_{axis}",
            unit="m",
            nominal=nominal,
            low=low,
            high=high,
            scale="linear",
            about=f"Where {what} is along {axis}.",
        )
        for axis, nominal, low, high in (
            (axis, middle, round(middle - reach, 9), round(middle + reach, 9))
            for axis, middle, reach in zip("xy", MIDDLE_M, REACH_M, strict=True)
        )
    )


def is_place(specs: Sequence[ParameterSpec]) -> bool:
    """True for the two parameters that `place` makes; others that say where or how are no place on the table."""
    names = [spec.name for spec in specs]
    stem = names[0].removesuffix("_x") if names else ""
    return names == [f"{stem}_x", f"{stem}_y"] and all(spec.unit == "m" for spec in specs)


def linear(
    name: str,
    unit: str,
    ends: tuple[float, float, float],
    about: str,
    scaling: tuple[int, int] = (0, 0),
    rod_null_prior: NullPrior | None = None,
    null_prior: NullPrior | None = None,
    liquid_null_prior: NullPrior | None = None,
) -> ParameterSpec:
    """A parameter that vanishes at 0, on a linear scale; `ends` are its lowest, typical and highest value."""
    low, typical, high = ends
    return ParameterSpec(
        name=name,
        unit=unit,
        nominal=0.0,
        low=low,
        high=high,
        typical=typical,
        scaling=scaling,
        scale="linear",
        about=about,
        null_prior=null_prior,
        rod_null_prior=rod_null_prior,
        liquid_null_prior=liquid_null_prior,
    )


@final
@dataclass(frozen=True, kw_only=True)
class Effect:
    """A physical term that vanishes where its parameters have their nominal (null) values.

    `parameters` are appended to phi; the first `switches` of them (None: all) make it vanish, the others say where or
    how it acts. The rest are hooks, Warp functions that are called where their physics belongs: each takes the value
    that it may change, the `NodeContext` or `ParticleContext` it belongs to, phi, and `at`: its parameters are
    `phi[at]`, `phi[at + 1]`, .... Warp differentiates them, so they have to be smooth at the null. What is not given is
    not compiled.
    """

    parameters: tuple[ParameterSpec, ...]
    switches: int | None = None
    reach_m: float | None = None
    """Farther than this from its place it does nothing; None: it acts everywhere."""
    needs_orientation: bool = False
    """True if it does nothing where nobody knows which end of the object is the first; material points then omit it."""
    odd: tuple[str, ...] = ()
    """Parameters that change their sign where the object's other end is called the first."""
    catalogued: bool = True
    """True if discovery may name it as a cause; else it is a library term for what no cause explains."""
    spelling: tuple[str, str] | None = None
    """Part of the file's and the parameters' names that is a name or a compound, and how people write it."""
    objects: frozenset[ObjectKind] = EVERY
    """Kinds of object that it acts on: what goes by the place along an object acts on ropes alone."""
    not_injectable: str = ""
    """Reason why no world of a rig can have it; where that is empty, `rig/simulated/injected_effects` has its file."""

    node_velocity: WarpFunction | None = None
    """Hook on a node's velocity [m/s], after gravity and before contact."""
    table_friction: WarpFunction | None = None
    """Hook on a node's Coulomb coefficient on the table."""
    adhesion: WarpFunction | None = None
    """Hook on the traction [Pa] with which tools hold a node that leaves them."""

    stiffness: WarpFunction | None = None
    """Hook on a particle's Young's modulus [Pa]."""
    mass: WarpFunction | None = None
    """Hook on a particle's mass [kg]."""
    rest: WarpFunction | None = None
    """Hook on a solid's deformation gradient, before stress is computed from it."""
    viscosity: WarpFunction | None = None
    """Hook on a particle's viscosity [Pa s]."""
    kept: WarpFunction | None = None
    """Hook on the share of its deviatoric stress that a solid keeps in a substep."""
    cohesion: WarpFunction | None = None
    """Hook on the cohesion [Pa] of grains."""
    tool_friction: WarpFunction | None = None
    """Hook on a particle's Coulomb coefficient on a tool."""

    rod: RodEffect | None = None
    """Effect on ropes simulated as rods; None: it has none, and models that need it cannot use rods."""
