"""Size of a cause as one number."""

import math
from dataclasses import dataclass
from itertools import takewhile
from typing import final

from app.discovery.results.case import CauseResult, Estimate


@final
@dataclass(frozen=True, kw_only=True)
class Size:
    """A size with its interval, in `unit`; not finite where it was not estimated."""

    value: float
    low: float
    high: float
    unit: str
    name: str
    """Name of the parameter, or of the effect where the size is a length."""


def size(blame: CauseResult) -> Size:
    """The size of a cause.

    Its active parameters are the leading estimates of one unit: those in another unit give place or form. A single one
    is its own size, with its sign. Several are a vector: the size is its length from the null, and the interval holds
    every length that parts within their own intervals can have, so that it is rather too wide.
    """
    if not blame.estimates:
        return Size(value=math.nan, low=math.nan, high=math.nan, unit="1", name=blame.effect)
    unit = blame.estimates[0].unit
    switches = tuple(takewhile(lambda estimate: estimate.unit == unit, blame.estimates))
    if len(switches) == 1:
        return Size(
            value=switches[0].value, low=switches[0].low, high=switches[0].high, unit=unit, name=switches[0].name
        )
    return Size(
        value=math.hypot(*(part.value - part.null for part in switches)),
        low=math.hypot(*(_nearest(part) for part in switches)),
        high=math.hypot(*(max(abs(part.low - part.null), abs(part.high - part.null)) for part in switches)),
        unit=unit,
        name=blame.effect,
    )


def _nearest(part: Estimate) -> float:
    """Least distance of a part from its null within its interval."""
    return 0.0 if part.low <= part.null <= part.high else min(abs(part.low - part.null), abs(part.high - part.null))
