"""Outcome of one case, as scores need it: hidden truth, conclusion, and errors of the models.

Pure: computed from the truth and `verdict.json` in a line of results.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, final

from app.sim.effects.base import Effect
from app.sim.model.catalogue import discover

SENSING = "sensing"
ACTUATION = "actuation"
CONTACT = "environment and contact"
MATERIAL = "material"
TIME = "time"
NUMERICS = "numerics"
OUTSIDE = "outside the catalogue"
NOTHING = "nothing"
CLASSES = (SENSING, ACTUATION, CONTACT, MATERIAL, TIME, NUMERICS, OUTSIDE, NOTHING)
"""Classes of causes, as the catalogue of discovery groups them."""

_OF_MATTER = ("stiffness", "mass", "rest", "viscosity", "kept", "cohesion")
"""Hooks of effects on what the object is made of."""


@final
@dataclass(frozen=True, kw_only=True)
class Truth:
    """A hidden effect. `typical`: its size in typical ones; `size`: as `verdict.json` sums sizes up."""

    effect: str
    category: str
    typical: float
    size: float
    null: float
    catalogued: bool = True


@final
@dataclass(frozen=True, kw_only=True)
class Blamed:
    """A cause of a verdict or of its ranking. NaN where nothing was estimated."""

    effect: str
    category: str
    probability: float
    size: float
    low: float
    high: float


@final
@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a case. Errors [mm] are on episodes left out; `oracle_mm` is NaN if the oracle was not run.

    `screening_s` and `whole_s`: how long the verdict took; `peak_mb`: the most memory that its process had.
    `world`: who made the recordings.
    """

    world: str
    truths: tuple[Truth, ...]
    verdict: str
    causes: tuple[Blamed, ...]
    ranking: tuple[Blamed, ...]
    nominal_mm: float = math.nan
    extended_mm: float = math.nan
    oracle_nominal_mm: float = math.nan
    oracle_mm: float = math.nan
    screening_s: float = math.nan
    whole_s: float = math.nan
    peak_mb: float = math.nan
    pushes: int = 0

    @property
    def outside(self) -> bool:
        """True if a hidden effect is no cause of the catalogue."""
        return any(not truth.catalogued for truth in self.truths)

    @property
    def single(self) -> Truth | None:
        """The only thing hidden, where it is one and a cause of the catalogue."""
        return self.truths[0] if len(self.truths) == 1 and not self.outside else None

    @property
    def hidden(self) -> frozenset[str]:
        """The names of what was hidden."""
        return frozenset(truth.effect for truth in self.truths)

    @property
    def named(self) -> tuple[str, ...]:
        """The causes that the verdict names, without those of our own numerics; none if it is a set."""
        if self.verdict != "named":
            return ()
        return tuple(cause.effect for cause in self.causes if cause.category != NUMERICS)

    @property
    def first(self) -> str:
        """First answer of the verdict: a cause, `NOTHING`, or `OUTSIDE`."""
        if self.verdict == "none_of_these":
            return OUTSIDE
        if self.verdict == "none" or not self.ranking:
            return NOTHING
        return self.causes[0].effect if self.causes else self.ranking[0].effect


def outcome(line: Mapping[str, Any]) -> Outcome:
    """Outcome of a line of results. KeyError if it holds no verdict."""
    verdict, oracle = line["verdict"], line.get("oracle") or {}
    sizes: dict[str, float] = dict(line["case"]["hidden"])
    spent = [(each["stage"], _number(each["seconds"])) for each in verdict["spent_s"]]
    return Outcome(
        world=line["case"]["world"],
        truths=tuple(_truth(each, sizes[each["effect"]]) for each in line["truth"]["effects"]),
        verdict=verdict["verdict"],
        causes=tuple(map(_blamed, verdict["causes"])),
        ranking=tuple(map(_blamed, verdict["ranking"])),
        nominal_mm=_number(verdict["heldout"]["nominal"]),
        extended_mm=_number(verdict["heldout"]["extended"]),
        oracle_nominal_mm=_number(oracle.get("nominal")),
        oracle_mm=_number(oracle.get("extended")),
        screening_s=_until_screened_s(spent),
        whole_s=sum(seconds for _, seconds in spent),
        peak_mb=_number((line.get("spent") or {}).get("peak_mb")),
        pushes=verdict["amount"]["pushes"],
    )


def category_of(effect: str, family: str, *, catalogued: bool = True) -> str:
    """The class of a cause, of those in `CLASSES`."""
    if not catalogued:
        return OUTSIDE
    if family != "physics":
        return family
    known = _effects().get(effect)
    if known is None:
        return CONTACT
    if any("session" in spec.unit for spec in known.parameters):
        return TIME
    return MATERIAL if any(getattr(known, hook) is not None for hook in _OF_MATTER) else CONTACT


def either_end() -> tuple[str, ...]:
    """Effects along the object, whose ends cannot be told apart: their signs have no meaning."""
    return tuple(name for name, effect in _effects().items() if effect.odd)


@cache
def _effects() -> dict[str, Effect]:
    return discover()


def size_of(parameters: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """A size as docs/discovery-verdict.md sums it up, of a truth's parameters, and its null.

    The leading ones of one unit: of one its value, of several the length of their vector from their nulls.
    """
    unit = parameters[0]["unit"]
    last = next((at for at, each in enumerate(parameters) if each["unit"] != unit), len(parameters))
    leading = parameters[:last]
    if len(leading) == 1:
        return float(leading[0]["value"]), float(leading[0]["null"])
    return math.dist([each["value"] for each in leading], [each["null"] for each in leading]), 0.0


def away(truth: Truth, size: float) -> float:
    """Distance of an estimate from the null, positive on the truth's side; unsigned if the sign has no meaning."""
    gone = size - truth.null
    return abs(gone) if truth.effect in either_end() else math.copysign(1.0, truth.size - truth.null) * gone


def _truth(told: Mapping[str, Any], typical: float) -> Truth:
    size, null = size_of(list(told["parameters"].values()))
    return Truth(
        effect=told["effect"],
        category=category_of(told["effect"], told["family"], catalogued=told["catalogued"]),
        typical=typical,
        size=size,
        null=null,
        catalogued=told["catalogued"],
    )


def _blamed(entry: Mapping[str, Any]) -> Blamed:
    return Blamed(
        effect=entry["effect"],
        category=category_of(entry["effect"], entry["family"]),
        probability=_number(entry["probability"]),
        size=_number(entry["size"]),
        low=_number(entry["low"]),
        high=_number(entry["high"]),
    )


def _until_screened_s(spent: Sequence[tuple[str, float]]) -> float:
    """All stages up to the screening; NaN where there is none."""
    ends = [at + 1 for at, (stage, _) in enumerate(spent) if stage.startswith("screening")]
    return sum(seconds for _, seconds in spent[: ends[0]]) if ends else math.nan


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
