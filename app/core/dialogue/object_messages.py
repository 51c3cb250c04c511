"""Messages about the object itself: what cameras measure of it, for a description of it."""

from dataclasses import dataclass
from typing import final

from app.core.colours import ColourRange
from app.core.geometry.object_description import ObjectType
from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True)
class MeasuredSize:
    """One size with its standard deviation, by the names of `object_description.SIZES_OF`, or another `name`.

    `seen` False: nobody measured it, and it is what the task's own object, if it were so large, would have.
    """

    name: str
    value: float
    sd: float
    seen: bool = True


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredObject(Message):
    """Sizes and colour of the object, from the last `views` of it.

    `colour`: RGB in 0..1, the median of its pixels; `hue_deg`, `saturation`, `value`: bounds of nearly all of them, as
    in `ColourRequest`; all empty where no camera saw any. `notes`: sentences on what is not measured. `cause` holds the
    ids of the newest particles and of the request.
    """

    kind: ObjectType
    views: int
    sizes: tuple[MeasuredSize, ...]
    colour: tuple[float, ...] = ()
    hue_deg: tuple[float, ...] = ()
    saturation: tuple[float, ...] = ()
    value: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def colours(self) -> ColourRange | None:
        """The range of colours that was seen; None where none was."""
        if not self.hue_deg:
            return None
        (hue_low, hue_high), (low, high), (dark, bright) = self.hue_deg, self.saturation, self.value
        return ColourRange.of((hue_low, hue_high), (low, high), (dark, bright))
