"""Effects, parameters and numbers in words; page, terminal and console share them.

Values come in SI units, or in those of `ParameterSpec.unit`, and are shown in units that make them easy to read, with
as many digits as their interval supports.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from app.core.dialogue.words import NOTHING, sentence
from app.discovery.dataset.names import effect_name

_LISTED: Final = 4
"""Most effects listed in a sentence."""
MINUS: Final = "\N{MINUS SIGN}"


@final
@dataclass(frozen=True, kw_only=True)
class Display:
    """Unit on display: `symbol` for `factor` times the number; `close`: no space between them."""

    factor: float
    symbol: str
    close: bool = False


_PLAIN: Final = {
    "1": "",
    "1/m": "m\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE}",
    "1/s": "s\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE}",
    "1/session": "per session",
    "session": "of a session",
    "Pa s": "Pa\N{MIDDLE DOT}s",
    "kg/m^3": "kg/m\N{SUPERSCRIPT THREE}",
    "m/s^2": "m/s\N{SUPERSCRIPT TWO}",
}
_SMALL: Final = {
    "m": Display(factor=1e3, symbol="mm"),
    "s": Display(factor=1e3, symbol="ms"),
    "m/s": Display(factor=1e3, symbol="mm/s"),
    "m/N": Display(factor=1e3, symbol="mm/N"),
    "1/Pa": Display(factor=1e3, symbol="kPa\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE}"),
}
_SMALL_BELOW: Final = {"m": 0.2, "s": 1.0, "m/s": 0.1, "m/N": 1.0, "1/Pa": 1.0}
_KILO_PASCALS_FROM: Final = 1e4


def title(effect: str) -> str:
    """An effect's id in words, with a capital first letter."""
    return sentence(effect_name(effect))


def names(effects: tuple[str, ...], last: str) -> str:
    """Effects in words, the last one after the word `last`: `a, b or c`; of many the first ones: `a, b or 7 more`."""
    said = [effect_name(effect) for effect in effects]
    if len(said) > _LISTED:
        said = [*said[: _LISTED - 1], f"{len(said) - _LISTED + 1} more"]
    return f"{', '.join(said[:-1])} {last} {said[-1]}" if len(said) > 1 else "".join(said)


def display(unit: str, *values: float) -> Display:
    """The unit in which the largest of `values` is easy to read."""
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if unit == "rad":
        return Display(factor=180 / math.pi, symbol="\N{DEGREE SIGN}", close=True)
    if unit == "deg":
        return Display(factor=1.0, symbol="\N{DEGREE SIGN}", close=True)
    if unit in _SMALL and largest < _SMALL_BELOW[unit]:
        return _SMALL[unit]
    if unit == "Pa" and largest >= _KILO_PASCALS_FROM:
        return Display(factor=1e-3, symbol="kPa")
    return Display(factor=1.0, symbol=_PLAIN.get(unit, unit))


def quantity(value: float, unit: str) -> str:
    """A number of unknown certainty with its unit, in two significant digits: `4.1 mm`."""
    shown = display(unit, value)
    return with_symbol(decimal(value * shown.factor, _decimals(abs(value * shown.factor) * 0.3)), shown)


def of(value: float, whole: float, unit: str) -> str:
    """A number against another one in one unit: `0.9 of 3 mm`."""
    shown = display(unit, value, whole)
    said = [decimal(it * shown.factor, _decimals(abs(it * shown.factor) * 0.3)) for it in (value, whole)]
    return with_symbol(" of ".join(said), shown)


def measurement(value: float, low: float, high: float, unit: str) -> str:
    """A number with its interval, `4.1 mm (3.6 to 4.6)`, rounded to what the interval supports."""
    shown, places = _common(value, low, high, unit)
    return f"{with_symbol(decimal(value * shown.factor, places), shown)} ({interval(value, low, high, unit)})"


def best(value: float, low: float, high: float, unit: str) -> str:
    """The number of `measurement` alone: `4.1 mm`."""
    shown, places = _common(value, low, high, unit)
    return with_symbol(decimal(value * shown.factor, places), shown)


def interval(value: float, low: float, high: float, unit: str) -> str:
    """The interval of `measurement` alone, without its unit: `3.6 to 4.6`."""
    shown, places = _common(value, low, high, unit)
    return f"{decimal(low * shown.factor, places)} to {decimal(high * shown.factor, places)}"


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{decimal(100 * share, 0)} %" if math.isfinite(share) else NOTHING


def gain_and_interval(value: float, low: float, high: float) -> str:
    """A share of an error that is removed: `58 % (49 to 66)`."""
    return f"{decimal(100 * value, 0)} % ({decimal(100 * low, 0)} to {decimal(100 * high, 0)})"


def decimal(value: float, places: int) -> str:
    """A number with so many decimal places (negative: round tens), a true minus sign, and no minus zero."""
    if not math.isfinite(value):
        return NOTHING
    text = f"{round(value, places):.{max(places, 0)}f}"
    return text.replace("-", "" if float(text) == 0 else MINUS)


def with_symbol(number: str, shown: Display) -> str:
    """A number and its unit."""
    return number if not shown.symbol or number == NOTHING else f"{number}{'' if shown.close else ' '}{shown.symbol}"


def _common(value: float, low: float, high: float, unit: str) -> tuple[Display, int]:
    shown = display(unit, value, low, high)
    half = abs(high - low) * shown.factor / 2
    return shown, _decimals(half if math.isfinite(half) and half > 0 else abs(value * shown.factor) * 0.3)


def _decimals(uncertainty: float) -> int:
    """Places so that the last digit is that of the uncertainty's first; one more where that is a 1 or 2."""
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 1
    order = math.floor(math.log10(uncertainty))
    leading = uncertainty / 10**order
    return min(-order + int(leading < 2.95), 6)
