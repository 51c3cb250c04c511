"""What stands in the cell of a task: one object, one tool, and what is fixed to the table. Plain data.

Rigs are built from it, and their processes shall not load JAX and Warp for these names. A kind of object is a class
here and a file in `app/rig/simulated/kinds`, which says what it does in a simulated world and what it looks like.
"""

from dataclasses import dataclass
from typing import TypeAlias, final

Colour: TypeAlias = tuple[float, float, float]
"""RGB albedo in 0..1."""
Vector: TypeAlias = tuple[float, float, float]


@final
@dataclass(frozen=True, kw_only=True)
class Rope:
    """A rope lying on the table; `rigid`: a rod of its size, which does not bend."""

    length_m: float
    radius_m: float
    mass_kg: float
    colour: Colour
    rigid: bool = False


@final
@dataclass(frozen=True, kw_only=True)
class Beans:
    """So many loose beans on the table, each a cylinder with round ends, `length_m` from tip to tip.

    `mass_kg` is that of all together. Their nodes are the middles of their round ends, two a bean, one after another.
    """

    count: int
    length_m: float
    radius_m: float
    mass_kg: float
    colour: Colour


@final
@dataclass(frozen=True, kw_only=True)
class Finger:
    """The closed two-finger gripper as a vertical capsule; `push_height_m` is its tip's height above the table."""

    radius_m: float
    push_height_m: float


@final
@dataclass(frozen=True, kw_only=True)
class Paddle:
    """A flat upright board, whose middle is the tool's position; `sweep_height_m` is that of its middle in a sweep.

    Half sides [m] across, along its thickness, and up: along x, y and z where the tool, pointing down, is not turned.
    """

    half_m: Vector
    sweep_height_m: float


@final
@dataclass(frozen=True, kw_only=True)
class Block:
    """An upright box that stands on the table or floats: half sides and middle [m]."""

    half_m: Vector
    place_m: Vector
    colour: Colour = (0.30, 0.32, 0.36)
    friction: float = 0.3


@final
@dataclass(frozen=True, kw_only=True)
class Mat:
    """A round mark on the table that nothing feels."""

    radius_m: float
    place_m: tuple[float, float]
    colour: Colour = (0.20, 0.35, 0.60)


Body: TypeAlias = Rope | Beans
Tool: TypeAlias = Finger | Paddle
Fixture: TypeAlias = Block | Mat


@final
@dataclass(frozen=True, kw_only=True)
class Stage:
    """A cell's contents."""

    body: Body
    tool: Tool
    fixtures: tuple[Fixture, ...] = ()
