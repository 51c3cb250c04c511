"""Fixtures on the table, each with its geometry. A kind of fixture is a class here, and a member of `Fixture`."""

from dataclasses import dataclass
from typing import ClassVar, Final, TypeAlias, final

import numpy as np
from jaxtyping import Bool

from app.core.geometry.shapes.base import Colour, FixtureGeometry, Vector
from app.core.geometry.shapes.meshes import TriangleMesh, bowl_mesh, box_mesh, rod_mesh, union_mesh
from app.core.types import Cloud

_MAT_M: Final = 0.001


@final
@dataclass(frozen=True, kw_only=True)
class Bowl(FixtureGeometry):
    """Half of a hollow sphere, upright and fixed, with its sphere's centre at `place_m`; `radius_m`: the inner one."""

    is_hollow: ClassVar[bool] = True

    radius_m: float
    thickness_m: float
    place_m: Vector
    friction: float = 0.1
    colour: Colour = (0.85, 0.84, 0.80)

    def contains(self, points: Cloud, margin_m: float) -> Bool[np.ndarray, " M"]:
        """Points in the wall, and none in the hollow."""
        away = points.astype(np.float64) - self.place_m
        off_wall = np.abs(np.linalg.norm(away, axis=1) - self.radius_m - self.thickness_m / 2)
        return (off_wall < self.thickness_m / 2 - margin_m) & (away[:, 2] < 0)

    def mesh(self) -> TriangleMesh:
        """Its wall."""
        return bowl_mesh(self.radius_m, self.thickness_m, self.place_m)


@final
@dataclass(frozen=True, kw_only=True)
class Obstacle(FixtureGeometry):
    """An upright box that stands on the table or floats: half sides and middle [m]."""

    half_m: Vector
    place_m: Vector
    colour: Colour = (0.30, 0.32, 0.36)
    friction: float = 0.3

    def contains(self, points: Cloud, margin_m: float) -> Bool[np.ndarray, " M"]:
        """Points in the box."""
        away = np.abs(points.astype(np.float64) - self.place_m)
        return np.all(away < np.asarray(self.half_m) - margin_m, axis=1)

    def mesh(self) -> TriangleMesh:
        """The box."""
        return box_mesh(self.half_m, self.place_m)


@final
@dataclass(frozen=True, kw_only=True)
class Mat(FixtureGeometry):
    """A round mark on the table without contact."""

    radius_m: float
    place_m: tuple[float, float]
    colour: Colour = (0.20, 0.35, 0.60)

    def contains(self, points: Cloud, margin_m: float) -> Bool[np.ndarray, " M"]:
        """None: it has no height."""
        del margin_m
        return np.zeros(len(points), np.bool_)

    def mesh(self) -> TriangleMesh:
        """The mark, as thick as a mat."""
        x, y = self.place_m
        return rod_mesh((x, y, 0.0), (x, y, _MAT_M), self.radius_m)


@final
@dataclass(frozen=True, kw_only=True)
class Rack(FixtureGeometry):
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

    def contains(self, points: Cloud, margin_m: float) -> Bool[np.ndarray, " M"]:
        """Points in a rod, whose ends are round."""
        x = points.astype(np.float64)
        deep = np.zeros(len(x), np.bool_)
        for start, end in np.asarray(self.ends_m()):
            along = (end - start) / np.linalg.norm(end - start)
            at = np.clip((x - start) @ along, 0.0, np.linalg.norm(end - start))
            deep |= np.linalg.norm(x - start - at[:, None] * along, axis=1) < self.radius_m - margin_m
        return deep

    def mesh(self) -> TriangleMesh:
        """The rods."""
        return union_mesh([rod_mesh(start, end, self.radius_m) for start, end in self.ends_m()])


Fixture: TypeAlias = Obstacle | Bowl | Mat | Rack
