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
class Finger:
    """The closed two-finger gripper as a vertical capsule; `push_height_m` is its tip's height above the table."""

    radius_m: float
    push_height_m: float


@final
@dataclass(frozen=True, kw_only=True)
class Block:
    """An upright box that stands on the table or floats: half sides and middle [m]."""

    half_m: Vector
    place_m: Vector
    colour: Colour = (0.30, 0.32, 0.36)
    friction: float = 0.3


Body: TypeAlias = Rope
Tool: TypeAlias = Finger
Fixture: TypeAlias = Block


@final
@dataclass(frozen=True, kw_only=True)
class Stage:
    """A cell's contents."""

    body: Body
    tool: Tool
    fixtures: tuple[Fixture, ...] = ()
