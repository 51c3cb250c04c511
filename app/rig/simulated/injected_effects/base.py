"""Interface of injected effects: each file has a module-level `HIDDEN`.

Effects have the names and parameters of discovery's catalogue, in real SI units; their equations are implemented
independently here, for another engine, so that discovery is not judged by its own code.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Beans, Body, Cloth, Liquid, Rope, Soup
from app.core.geometry.track import Track
from app.core.types import ColourImage, DepthImage, Transform
from app.rig.simulated.worlds.physics import Position, WorldPhysics

ROPES: Final = (Rope,)
ON_TABLES: Final = (Rope, Beans)
"""Objects that lie on the table and are pushed over it."""
SOLIDS: Final = (Rope, Beans, Cloth)
"""Objects that a tool moves as it touches or holds them: ropes, beans and cloths."""
LIQUIDS: Final = (Liquid, Soup)
"""Objects that are poured."""
SOUPS: Final = (Soup,)
ON_TABLES_OR_POURED: Final = (*ON_TABLES, *LIQUIDS)
ANY_BODY: Final = (Rope, Beans, Cloth, Liquid, Soup)
"""Objects of every kind: errors of arm and cameras are in what moves and sees them."""

Values: TypeAlias = Float64[np.ndarray, " V"]
"""Values of an effect's parameters, in their order."""
Factors: TypeAlias = Float64[np.ndarray, " S"]
"""One number for each of the object's S bodies: a rope's segments, or beans."""
Vectors: TypeAlias = Float64[np.ndarray, "S 3"]
"""One vector for each of the object's bodies, in the world frame."""


class Moment(NamedTuple):
    """State of the world at one time step, as seen by effects.

    `session`: -0.5 at the first push of all and 0.5 at the last. `x`, `v`, `mass`: of the bodies [m, m/s, kg], each
    `length_m` long and `radius_m` thick; `toward (S, 3)`: unit vectors from each to the tool's nearest point, and
    `gap_m` between their surfaces.
    """

    time_s: float
    session: float
    period_s: float
    gravity_m_s2: float
    radius_m: float
    length_m: float
    x: Vectors
    v: Vectors
    mass: Factors
    tool: Position
    tool_v: Position
    toward: Vectors
    gap_m: Factors


class SensorImages(NamedTuple):
    """A raw image pair of the sensor, and the colour (RGB, 0..1) of the object in it."""

    color: ColourImage
    depth: DepthImage
    camera: CameraModel
    object_colour: tuple[float, float, float]


@final
@dataclass(frozen=True, kw_only=True)
class InjectedParameter:
    """A parameter of an effect: at `null` the effect vanishes, `typical` is a realistic size, in SI units.

    `low` and `high` bound the sizes that can be requested. Parameters of place or time have no typical value.
    """

    name: str
    unit: str
    null: float = 0.0
    typical: float | None = None
    low: float = 0.0
    high: float = np.inf


Draw: TypeAlias = Callable[[float, np.random.Generator], Values]


@final
@dataclass(frozen=True, kw_only=True)
class Hidden:
    """An injectable effect: its parameters, their distribution for a size, the bodies it can be in, and its hooks.

    `bodies`: classes of `scene_description`. `beans_share`: typical and largest size in beans, as a share of those in
    ropes: they roll where a rope is held; `liquid_share`: the same in liquids, whose world is our own engine, which has
    its own term for each effect and needs no hook. Hooks that are not given change nothing. In the world: `physics` and
    `build` act before MuJoCo compiles its model (the latter on the `MjSpec`, whose rope is the bodies rope0, ...);
    `friction` is the factor of the table's friction under each body, `force` acts on each [N], `stiffness` is the
    factor of a rope's hinges' or of beans' contacts', and `relaxed` the share of the hinges' elastic bend that becomes
    permanent in a duration. In the arm: `drive` is the tip's actual track for a commanded one, and `told` is True where
    its encoders measure that. In the cameras: `stands` is their true pose (about the `middle` of all), `seen` their
    depth image with its losses, and `late_s` their delay after the stamp. `more`: the share of a liquid's volume by
    which there is more of it than its task says.
    """

    family: Literal["physics", "sensing", "actuation"]
    bodies: tuple[type[Body], ...]
    quantities: tuple[InjectedParameter, ...]
    draw: Draw
    catalogued: bool = True
    beans_share: float = 1.0
    liquid_share: float = 1.0
    physics: Callable[[WorldPhysics, Body, Values], WorldPhysics] | None = None
    build: Callable[[Any, WorldPhysics, Values], None] | None = None
    friction: Callable[[Moment, Values], Factors] | None = None
    force: Callable[[Moment, Values], Vectors] | None = None
    stiffness: Callable[[Moment, Values], Factors] | None = None
    relaxed: Callable[[float, Values], float] | None = None
    drive: Callable[[Track, Values], Track] | None = None
    told: bool = False
    stands: Callable[[Transform, Position, Values], Transform] | None = None
    seen: Callable[[SensorImages, Values], DepthImage] | None = None
    late_s: Callable[[Values], float] | None = None
    more: Callable[[Values], float] | None = None

    @property
    def main(self) -> InjectedParameter:
        """The parameter that a size refers to."""
        return self.quantities[0]

    def main_in(self, body: type[Body]) -> InjectedParameter:
        """The same, with its sizes in an object of that class."""
        shares: dict[type[Body], float] = {Beans: self.beans_share, **dict.fromkeys(LIQUIDS, self.liquid_share)}
        main, share = self.main, shares.get(body, 1.0)
        if share == 1.0 or main.typical is None:
            return main
        return replace(main, typical=share * main.typical, high=share * main.high)

    @property
    def in_world(self) -> bool:
        """True where it changes object, table or tool, and not arm and cameras alone."""
        hooks = (self.physics, self.build, self.friction, self.force, self.stiffness, self.relaxed)
        return self.family == "physics" or any(hook is not None for hook in hooks)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class InjectedEffect:
    """An effect with its injected values."""

    name: str
    effect: Hidden
    values: Values


def plain(size: float, _rng: np.random.Generator) -> Values:
    """Values of the size itself."""
    return np.array([size])


def with_random_sign(size: float, rng: np.random.Generator) -> Values:
    """The size with a random sign."""
    return np.array([size * rng.choice([-1.0, 1.0])])


def level(size: float, rng: np.random.Generator) -> Values:
    """A vector of that length in the plane, in a random direction."""
    angle = rng.uniform(0, 2 * np.pi)
    return size * np.array([np.cos(angle), np.sin(angle)])


def spatial(size: float, rng: np.random.Generator) -> Values:
    """A vector of that length in space, in a random direction."""
    drawn = rng.standard_normal(3)
    return size * drawn / np.linalg.norm(drawn)


def with_random_place(size: float, rng: np.random.Generator) -> Values:
    """The size, and a random position x, y in the region of the pushes [m]."""
    return np.array([size, rng.uniform(0.45, 0.65), rng.uniform(-0.15, 0.15)])


def signed_placed(size: float, rng: np.random.Generator) -> Values:
    """As `with_random_place`, with a random sign."""
    return with_random_place(size * rng.choice([-1.0, 1.0]), rng)


def components(name: str, axes: str, unit: str, typical: float, high: float) -> tuple[InjectedParameter, ...]:
    """The components of a vector: `name`_x, `name`_y, ...; the size is its length."""
    return tuple(InjectedParameter(name=f"{name}_{axis}", unit=unit, typical=typical, high=high) for axis in axes)


def where(name: str) -> tuple[InjectedParameter, InjectedParameter]:
    """Parameters `name`_x and `name`_y: a position on the table."""
    return (
        InjectedParameter(name=f"{name}_x", unit="m", null=0.55, low=-np.inf),
        InjectedParameter(name=f"{name}_y", unit="m", low=-np.inf),
    )


def acting(moment: Moment, acceleration: Vectors) -> Vectors:
    """Forces [N] for an acceleration [m/s^2] of each body."""
    return moment.mass[:, None] * acceleration
