"""Object, tool and table of imported data as they are simulated, with sources. Plain data, kept in a recording."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import degrees
from typing import Final, Literal, TypeAlias, final

Source: TypeAlias = Literal["data", "about", "task"]
"""Source of a number: measured in the clouds; stated by the author of the data; or the task's own default."""
ToolPoints: TypeAlias = Literal["none", "tip", "surface"]
"""Meaning of the tool's points: there are none; their mean is its tip; they lie on its surface."""

_MM, _GRAM = 1e3, 1e3

KEY: Final = "setup"
"""Key of the setup in the configuration of a recording's `Episode`."""


@final
@dataclass(frozen=True, kw_only=True)
class SourcedSize:
    """One size of object or tool, in SI units, by its name in `object_description.SIZES`; `sd`: 0 where unknown."""

    name: str
    value: float
    source: Source
    sd: float = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class FoundTable:
    """The table as found in the frame of the data.

    `taken_out`: its height and tilt have been removed from the recording, which is in the table's own frame; its points
    are then no evidence about the cameras. Otherwise it was at its stated place, within the cameras' accuracy.
    """

    height_m: float = 0.0
    tilt_deg: float = 0.0
    uneven_m: float = 0.0
    flat: bool = True
    seen: Literal["points", "clouds", "none"] = "none"
    taken_out: bool = False

    @property
    def words(self) -> str:
        """Sentence on the table's pose and on its source."""
        by = {"points": "its points", "clouds": "the lowest points of the clouds", "none": ""}[self.seen]
        where = f"{self.height_m:.3f} m high and tilted by {self.tilt_deg:.1f} degrees"
        if self.taken_out:
            return f"Table: it was {where} in the data (from {by}); places are given above it."
        if self.seen == "points":
            return (
                f"Table: at height 0, as was said; {by} have it {_MM * self.height_m:.0f} mm high and tilted by "
                f"{self.tilt_deg:.1f} degrees, which cameras may err by."
            )
        return "Table: at height 0, as was said."


@final
@dataclass(frozen=True, kw_only=True)
class MeasuredSetup:
    """Object, tool and table as they are simulated for an imported recording."""

    sizes: tuple[SourcedSize, ...]
    table: FoundTable
    tool_points: ToolPoints = "none"
    push_height_m: float = 0.0
    """Height of the tool's tip above the table in a usual push."""
    camera_m: tuple[float, float, float] | None = None
    flaws: tuple[str, ...] = ()
    """Sentences on aspects that cannot be simulated: no cause is named."""
    notes: tuple[str, ...] = ()
    """Sentences on other findings worth knowing."""

    def source(self, name: str) -> Source:
        """Source of a size; the task where no other is given."""
        for size in self.sizes:
            if size.name == name:
                return size.source
        return "task"

    @property
    def words(self) -> tuple[str, ...]:
        """One sentence each on object, tool and table, with the source of every number."""
        said = {size.name: size for size in self.sizes}
        rope = (
            f"Object: a rope {said['length_m'].value:.3f} m long ({_source_text(said['length_m'])}), of "
            f"{_MM * said['radius_m'].value:.1f} mm radius ({_source_text(said['radius_m'])}) and "
            f"{_GRAM * said['mass_kg'].value:.0f} g ({_source_text(said['mass_kg'])})."
        )
        return rope, self._tool(said), self.table.words

    def _tool(self, said: Mapping[str, SourcedSize]) -> str:
        radius, width = said["finger_radius_m"], said["finger_half_width_m"]
        if width.value == 0:
            return f"Tool: round, of {_MM * radius.value:.1f} mm radius ({_source_text(radius)})."
        yaw = said["finger_yaw_rad"]
        return (
            f"Tool: flat, {2 * _MM * radius.value:.1f} mm thick ({_source_text(radius)}), "
            f"{2 * _MM * (width.value + radius.value):.1f} mm wide ({_source_text(width)}), turned by "
            f"{degrees(yaw.value):.0f} degrees ({_source_text(yaw)})."
        )


def _source_text(size: SourcedSize) -> str:
    """Source of a size, in words."""
    if size.source == "data":
        return "from the data" + (f", known to {_GIVEN[size.name](size.sd)}" if size.sd > 0 else "")
    task = "as dense as the task's, and fitted" if size.name == "mass_kg" else "the task's"
    return {"about": "from about", "task": task}[size.source]


_GIVEN: Final[Mapping[str, Callable[[float], str]]] = {
    "length_m": lambda sd: f"{_MM * sd:.0f} mm",
    "radius_m": lambda sd: f"{_MM * sd:.1f} mm",
    "mass_kg": lambda sd: f"{_GRAM * sd:.0f} g",
    "finger_radius_m": lambda sd: f"{_MM * sd:.1f} mm",
    "finger_half_width_m": lambda sd: f"{_MM * sd:.1f} mm",
    "finger_yaw_rad": lambda sd: f"{degrees(sd):.0f} degrees",
}
