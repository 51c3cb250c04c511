"""Numbers within their ranges."""

import math

from app.core.errors import ParameterError


def check_range(name: str, value: float, low: float, high: float) -> float:
    """`value`, or a ParameterError that names it and its range where it is non-finite or outside [low, high]."""
    if not math.isfinite(value) or not low <= value <= high:
        raise ParameterError(f"{name} = {value:g} is outside its range {low:g} to {high:g}.")
    return value
