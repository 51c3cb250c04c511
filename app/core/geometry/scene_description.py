"""Scene description of a task's cell: one object, one tool, and the fixtures on the table. Plain data.

Rigs are built from it, and their processes must not load JAX and Warp for these names. A kind of object is a class here
and a file in `app/rig/simulated/kinds`, which gives its simulation and its appearance.
"""

from dataclasses import dataclass, replace
from typing import Literal, Self, TypeAlias, final

from app.core.errors import UsageError
from app.core.geometry.shapes.base import Colour
from app.core.geometry.shapes.fixtures import Fixture
from app.core.geometry.shapes.tools import Tool

RopeModel: TypeAlias = Literal["chain", "cable"]
"""Simulation model of a rope: rigid bodies joined by hinges, or mass points joined by elastic segments."""


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

    @property
    def mass_kg(self) -> float:
        """Its mass [kg]."""
        return self.density_kg_m3 * self.volume_m3

    def with_more(self, more_m3: float) -> Self:
        """The same with so much more of it [m^3], of as many drops."""
        return replace(self, volume_m3=self.volume_m3 + more_m3)


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
    def along(self) -> int:
        """Particles along the edge of a piece, the fewest of any kind."""
        return min(kind.along for kind in self.pieces)

    @property
    def solid_m3(self) -> float:
        """Total volume of the pieces [m^3]."""
        return sum(kind.volume_m3 for kind in self.pieces)

    @property
    def volume_m3(self) -> float:
        """Total volume of liquid and pieces [m^3]."""
        return self.liquid.volume_m3 + self.solid_m3

    @property
    def mass_kg(self) -> float:
        """Total mass of liquid and pieces [kg]."""
        return self.liquid.mass_kg + sum(kind.density_kg_m3 * kind.volume_m3 for kind in self.pieces)

    def with_more(self, more_m3: float) -> Self:
        """The same with so much more liquid [m^3], of as many drops."""
        return replace(self, liquid=self.liquid.with_more(more_m3))


@final
@dataclass(frozen=True, kw_only=True)
class Cloth:
    """A square cloth, simulated as a square grid of `nodes_a_side` nodes a side."""

    size_m: float
    mass_kg: float
    colour: Colour
    nodes_a_side: int = 15


Body: TypeAlias = Rope | Beans | Cloth | Liquid | Soup


@final
@dataclass(frozen=True, kw_only=True)
class Stage:
    """A cell's contents. `settle_s`: the least time [s] that the body is given to come to rest after a motion."""

    body: Body
    tool: Tool
    fixtures: tuple[Fixture, ...] = ()
    settle_s: float = 0.0

    def in_world(self, world: RopeModel) -> "Stage":
        """The same stage with this model of its rope. Raises UsageError where there is no rope."""
        if isinstance(self.body, Rope):
            return self if self.body.rigid else replace(self, body=replace(self.body, model=world))
        if world == "chain":
            return self
        raise UsageError(f"--world {world} is of tasks with a rope, not with {type(self.body).__name__}; leave it out.")
