"""Scene description of a task's cell: one object, one tool, and the fixtures on the table. Plain data.

Rigs are built from it, and their processes must not load JAX and Warp for these names. A kind of object is a class here
and a file in `app/rig/simulated/kinds`, which gives its simulation and its appearance.
"""

from dataclasses import dataclass, replace
from math import cos, sin
from typing import Literal, TypeAlias, final

from app.core.errors import UsageError

RopeModel: TypeAlias = Literal["chain", "cable"]
"""Simulation model of a rope: rigid bodies joined by hinges, or mass points joined by elastic segments."""
Colour: TypeAlias = tuple[float, float, float]
"""RGB albedo in 0..1."""
Vector: TypeAlias = tuple[float, float, float]


@final
@dataclass(frozen=True, kw_only=True)
class Rope:
    """A rope lying on the table; `rigid`: a rod of its size, which does not bend.

    `model`: its model in a simulated world; a rod is always a chain.
    """

    length_m: float
    radius_m: float
    mass_kg: float
    colour: Colour
    rigid: bool = False
    model: RopeModel = "chain"


@final
@dataclass(frozen=True, kw_only=True)
class Beans:
    """`count` loose beans on the table, each a cylinder with round ends, `length_m` from tip to tip.

    `mass_kg` is their total. Their nodes are the centres of their round ends, two a bean, one after another.
    """

    count: int
    length_m: float
    radius_m: float
    mass_kg: float
    colour: Colour


@final
@dataclass(frozen=True, kw_only=True)
class Liquid:
    """A coloured liquid, at first in the bowl held by the arm; `drops`: particle count in a simulated world."""

    volume_m3: float
    colour: Colour
    density_kg_m3: float = 1000.0
    drops: int = 2400


@final
@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Elastic cubes of one kind. Each is `along`^3 particles in a simulated world."""

    count: int
    edge_m: float
    density_kg_m3: float
    young_pa: float
    colour: Colour
    along: int = 4

    @property
    def volume_m3(self) -> float:
        """Total volume [m^3]."""
        return self.count * self.edge_m**3

    @property
    def grains(self) -> int:
        """Total number of particles in a simulated world."""
        return self.count * self.along**3


@final
@dataclass(frozen=True, kw_only=True)
class Soup:
    """A liquid with pieces floating in it, at first in the bowl held by the arm. `liquid`: without the pieces."""

    liquid: Liquid
    pieces: tuple[Pieces, ...]

    @property
    def colour(self) -> Colour:
        """Colour of the liquid."""
        return self.liquid.colour

    @property
    def solid_m3(self) -> float:
        """Total volume of the pieces [m^3]."""
        return sum(kind.volume_m3 for kind in self.pieces)

    @property
    def volume_m3(self) -> float:
        """Total volume of liquid and pieces [m^3]."""
        return self.liquid.volume_m3 + self.solid_m3


@final
@dataclass(frozen=True, kw_only=True)
class Finger:
    """The closed two-finger gripper, which points down: every point within `radius_m` of its core.

    The core is an upright strip on a level line through the tool, `half_width_m` to either side of it, at `yaw_rad`
    from the world's x axis. Without width the finger is a capsule. `push_height_m`: its tip's height above the table.
    """

    radius_m: float
    push_height_m: float
    half_width_m: float = 0.0
    yaw_rad: float = 0.0

    @property
    def half_m(self) -> tuple[float, float]:
        """Vector from the tool to an end of that line [m], seen from above."""
        if self.half_width_m == 0:
            return 0.0, 0.0
        return self.half_width_m * cos(self.yaw_rad), self.half_width_m * sin(self.yaw_rad)

    def ends_m(self) -> list[Vector]:
        """Vectors from the tool to the ends of that line [m], in the world; zero for a finger without width."""
        x, y = self.half_m
        return [(-x, -y, 0.0), (x, y, 0.0)] if self.half_width_m > 0 else [(0.0, 0.0, 0.0)]


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
class HeldBowl:
    """Half of a hollow sphere in the hand, with its centre at the tool's position; upright where the tool points down.

    `radius_m`: the inner one.
    """

    radius_m: float
    thickness_m: float
    friction: float = 0.1
    colour: Colour = (0.85, 0.84, 0.80)


@final
@dataclass(frozen=True, kw_only=True)
class Bowl:
    """A bowl as above, upright and fixed, with its sphere's centre at `place_m`."""

    radius_m: float
    thickness_m: float
    place_m: Vector
    friction: float = 0.1
    colour: Colour = (0.85, 0.84, 0.80)


@final
@dataclass(frozen=True, kw_only=True)
class Cloth:
    """A square cloth, simulated as a square grid of `nodes_a_side` nodes a side."""

    size_m: float
    mass_kg: float
    colour: Colour
    nodes_a_side: int = 15


@final
@dataclass(frozen=True, kw_only=True)
class Gripper:
    """Two upright fingers, boxes of the half sides `half_m`, that open along y; the tool is the point between the tips.

    They open up to `opening_m`, and hold an object between them where they are `closed_m` apart or less.
    """

    half_m: Vector
    opening_m: float
    closed_m: float


@final
@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """An upright box that stands on the table or floats: half sides and middle [m]."""

    half_m: Vector
    place_m: Vector
    colour: Colour = (0.30, 0.32, 0.36)
    friction: float = 0.3


@final
@dataclass(frozen=True, kw_only=True)
class Mat:
    """A round mark on the table without contact."""

    radius_m: float
    place_m: tuple[float, float]
    colour: Colour = (0.20, 0.35, 0.60)


@final
@dataclass(frozen=True, kw_only=True)
class Rack:
    """`count` level rods along x, `spacing_m` apart; `place_m`: the centre of the rack."""

    count: int
    spacing_m: float
    half_length_m: float
    radius_m: float
    place_m: Vector
    colour: Colour = (0.30, 0.32, 0.36)
    friction: float = 0.3

    def ends_m(self) -> list[tuple[Vector, Vector]]:
        """Both ends of the axis of each rod."""
        x, y, z = self.place_m
        across = [y + (index - (self.count - 1) / 2) * self.spacing_m for index in range(self.count)]
        return [((x - self.half_length_m, at, z), (x + self.half_length_m, at, z)) for at in across]


Body: TypeAlias = Rope | Beans | Cloth | Liquid | Soup
Tool: TypeAlias = Finger | Paddle | Gripper | HeldBowl
Fixture: TypeAlias = Obstacle | Bowl | Mat | Rack


@final
@dataclass(frozen=True, kw_only=True)
class Stage:
    """A cell's contents."""

    body: Body
    tool: Tool
    fixtures: tuple[Fixture, ...] = ()

    def in_world(self, world: RopeModel) -> "Stage":
        """The same stage with this model of its rope. Raises UsageError where there is no rope."""
        if isinstance(self.body, Rope):
            return self if self.body.rigid else replace(self, body=replace(self.body, model=world))
        if world == "chain":
            return self
        raise UsageError(f"--world {world} is of tasks with a rope, not with {type(self.body).__name__}; leave it out.")
