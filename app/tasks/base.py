"""What a task is: data about a scene, an object, a tool and how to plan there. One file a task, named as the task."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, kw_only=True)
class Rope:
    """A rope lying on the table. `colour` is its RGB albedo in 0..1."""

    length_m: float
    radius_m: float
    mass_kg: float
    colour: tuple[float, float, float]


@final
@dataclass(frozen=True, kw_only=True)
class Finger:
    """The closed two-finger gripper as a vertical capsule; `push_height_m` is its tip's height above the table."""

    radius_m: float
    push_height_m: float
