"""Size of a cause as one number."""

import math
from itertools import takewhile

from app.discovery.results.case import CauseResult, Estimate


def size(blame: CauseResult) -> Estimate:
    """The size of a cause; not finite where it was not estimated.

    Its active parameters are the leading estimates of one unit: those in another unit give place or form. A single one
    is its own size, with its sign. Several are a vector: the size is its length from the null, named as the effect, and
    the interval holds every length that parts within their own intervals can have, so that it is rather too wide.
    """
    if not blame.estimates:
        return _sized(blame, "1", math.nan, math.nan, math.nan)
    unit = blame.estimates[0].unit
    switches = tuple(takewhile(lambda estimate: estimate.unit == unit, blame.estimates))
    if len(switches) == 1:
        return switches[0]
    return _sized(
        blame,
        unit,
        math.hypot(*(part.value - part.null for part in switches)),
        math.hypot(*(_nearest(part) for part in switches)),
        math.hypot(*(max(abs(part.low - part.null), abs(part.high - part.null)) for part in switches)),
    )


def _sized(blame: CauseResult, unit: str, value: float, low: float, high: float) -> Estimate:
    return Estimate(name=blame.effect, about=blame.about, value=value, unit=unit, low=low, high=high, null=0.0)


def _nearest(part: Estimate) -> float:
    """Least distance of a part from its null within its interval."""
    return 0.0 if part.holds_null else min(abs(part.low - part.null), abs(part.high - part.null))
