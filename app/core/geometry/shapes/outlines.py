"""Outlines of tools that push, seen from above, about the tool's position."""

from dataclasses import dataclass
from typing import Protocol, TypeAlias, final

import numpy as np
from jaxtyping import Float64

Plan: TypeAlias = Float64[np.ndarray, "P 2"]
"""Points seen from above [m]."""
Direction: TypeAlias = Float64[np.ndarray, "2"]
"""Unit vector seen from above."""

_NO_WIDTH_M = 1e-6


class Outline(Protocol):
    """Convex outline of a tool at one pose, the same upwards from its lowest part."""

    @property
    def bottom_m(self) -> float:
        """Height of its lowest part [m, world]; lower points are not touched."""
        ...

    @property
    def extent_m(self) -> float:
        """Distance from the tool's middle to the farthest corner."""
        ...

    def half_extent_m(self, ahead: Direction) -> float:
        """Distance from the tool's middle to its back, for a motion in direction `ahead`."""
        ...

    def exit_m(self, offsets: Plan, ahead: Direction) -> Float64[np.ndarray, " P"]:
        """Distance to the edge in direction `ahead` of points at these offsets from the middle; 0 outside."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class Stadium:
    """Every point within a radius of the line from `-half_m` to `half_m`: two discs and a rectangle.

    `half_width_m`: length of `half_m`, half of the line's.
    """

    half_m: tuple[float, float]
    half_width_m: float
    radius_m: float
    bottom_m: float

    @property
    def extent_m(self) -> float:
        """Half of the line, and the radius."""
        return self.radius_m + self.half_width_m

    def half_extent_m(self, ahead: Direction) -> float:
        """The radius, behind the end of the line that is farther back."""
        return self.radius_m + float(abs(np.asarray(self.half_m) @ ahead))

    def exit_m(self, offsets: Plan, ahead: Direction) -> Float64[np.ndarray, " P"]:
        """Distance to where the last of the three parts is left."""
        half_m, radius_m = np.asarray(self.half_m), self.radius_m
        aside, width_m = np.array([-ahead[1], ahead[0]]), np.linalg.norm(half_m)
        along, across = offsets @ ahead, offsets @ aside
        chords = [radius_m**2 - (across - end @ aside) ** 2 for end in (-half_m, half_m)]
        leaves = [
            np.where(chord > 0, end @ ahead + np.sqrt(np.maximum(chord, 0.0)), -np.inf)
            for chord, end in zip(chords, (-half_m, half_m), strict=True)
        ]
        place = np.zeros(len(offsets))
        if width_m > _NO_WIDTH_M:
            place = np.clip(offsets @ half_m / width_m**2, -1.0, 1.0)
            axes = np.array([half_m, [-half_m[1], half_m[0]]]) / width_m
            sides, way = np.array([width_m, radius_m]), axes @ ahead
            sign, speed = np.where(way < 0, -1.0, 1.0), np.maximum(np.abs(way), np.finfo(float).eps)
            ahead_m = ((sides - sign * (offsets @ axes.T)) / speed).min(axis=1)
            behind_m = ((-sides - sign * (offsets @ axes.T)) / speed).max(axis=1)
            leaves.append(np.where(ahead_m > behind_m, along + ahead_m, -np.inf))
        inside = np.linalg.norm(offsets - place[:, None] * half_m, axis=1) < radius_m
        return np.where(inside, np.max(leaves, axis=0) - along, 0.0)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Rectangle:
    """A rectangle of these half sides along its own `axes`, one a row."""

    axes: Float64[np.ndarray, "2 2"]
    half_m: tuple[float, float]
    bottom_m: float

    @property
    def extent_m(self) -> float:
        """Half of the diagonal."""
        return float(np.hypot(*self.half_m))

    def half_extent_m(self, ahead: Direction) -> float:
        """Distance to the corner that is farthest back."""
        return float(np.abs(self.axes @ ahead) @ self.half_m)

    def exit_m(self, offsets: Plan, ahead: Direction) -> Float64[np.ndarray, " P"]:
        """Distance to the first side that is met."""
        half_m = np.asarray(self.half_m)
        place, way = offsets @ self.axes.T, self.axes @ ahead
        inside = np.all(np.abs(place) < half_m, axis=1)
        speed = np.maximum(np.abs(way), np.finfo(float).eps)
        return np.where(inside, ((half_m - np.sign(way) * place) / speed).min(axis=1), 0.0)
