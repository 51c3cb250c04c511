"""Schema of `verdict.json`: documented in docs/discovery-verdict.md, from which other programs read it.

JSON has no infinity and no NaN: such a number is null, and each description gives its meaning.
"""

import re
from typing import Annotated, Literal, final

import msgspec
from msgspec import Meta, Struct

from app.core.dialogue.model_monitor_messages import VerdictKind
from app.discovery.dataset.model_under_test import Family

_DIALECT = "https://json-schema.org/draft/2020-12/schema"

Maybe = Annotated[float | None, Meta(description="Null where it is not known.")]
Chance = Annotated[float | None, Meta(description="A probability, 0 to 1; null where it is not known.")]


@final
class ParameterEntry(Struct, frozen=True, kw_only=True):
    """A parameter with its 90 % interval, in `unit`."""

    name: str
    value: Maybe
    unit: str
    low: Maybe
    high: Maybe


@final
class CauseEntry(Struct, frozen=True, kw_only=True):
    """A cause by the id of its effect, with its size and all of its parameters.

    The size of a single active parameter is its value; of several, the length of their vector. `low` and `high` bound
    it at 90 %; those of a length hold every length that the parts' own intervals allow.
    """

    effect: str
    family: Family
    size: Maybe
    unit: str
    low: Maybe
    high: Maybe
    probability: Chance
    log_bayes: Maybe
    parameters: tuple[ParameterEntry, ...]


@final
class TermEntry(Struct, frozen=True, kw_only=True):
    """One term of a formula, in symbols and in words."""

    formula: str
    words: str
    parameters: tuple[ParameterEntry, ...]


@final
class FormulaEntry(Struct, frozen=True, kw_only=True):
    """A force on the object outside the catalogue of causes, as a share of its weight."""

    text: str
    words: str
    terms: tuple[TermEntry, ...]


@final
class HeldoutEntry(Struct, frozen=True, kw_only=True):
    """One-step errors [mm] on episodes that the models were not fitted to, and the share of the error that is removed.

    Null gain: the nominal model has no error to remove, or there were too few episodes.
    """

    nominal: Maybe
    extended: Maybe
    still: Maybe
    gain: Maybe
    low: Maybe
    high: Maybe
    episodes: int


@final
class TrackEntry(Struct, frozen=True, kw_only=True):
    """Times [s] and poses of the tool's tip: x y z [m], quaternion w x y z, and of a gripper its opening [m]."""

    times_s: tuple[float, ...]
    poses: tuple[Annotated[tuple[float, ...], Meta(min_length=7, max_length=8)], ...]


@final
class NextPushEntry(Struct, frozen=True, kw_only=True):
    """The push that best discriminates the models in `between`, and the distance of their predicted objects [mm]."""

    text: str
    between: tuple[str, ...]
    apart_mm: Maybe
    track: TrackEntry


@final
class PushEntry(Struct, frozen=True, kw_only=True):
    """A push chosen to discriminate the rivals in `between`; `nats` as in docs/discovery.md."""

    text: str
    between: tuple[str, ...]
    nats: float
    track: TrackEntry


@final
class PushesFile(Struct, frozen=True, kw_only=True):
    """Content of `pushes.json`: pushes to make next, in their order."""

    task: str
    pushes: tuple[PushEntry, ...]


@final
class LimitEntry(Struct, frozen=True, kw_only=True):
    """A limitation of these data, and its consequence. A fatal one forbids to name any cause."""

    text: str
    consequence: str
    fatal: bool


@final
class PowerEntry(Struct, frozen=True, kw_only=True):
    """The smallest size that would be visible in these data, beside a typical one."""

    effect: str
    parameter: str
    least: Annotated[float | None, Meta(description="Null where these data cannot show it at any size.")]
    typical: Maybe
    unit: str


@final
class AmountEntry(Struct, frozen=True, kw_only=True):
    """Amount of data analysed."""

    task: str
    episodes: int
    pushes: int
    during: int
    measured: int
    particles: int


@final
class SpentEntry(Struct, frozen=True, kw_only=True):
    """Time spent in a stage [s]."""

    stage: str
    seconds: Maybe


@final
class VerdictFile(Struct, frozen=True, kw_only=True):
    """Result of `dipac discover`. Intervals are 90 %; units are SI but where `unit` says otherwise.

    `causes`: those that act together where the verdict is `named`, the alternatives where it is `set`, else none.
    `simulated`: object, tool and table, each in a sentence with the source of its numbers. `ranking`: everything that
    was weighed. `headline`: the verdict in a few words; `probability`: that of the statement in `probability_of`;
    `advice`: the next steps.
    """

    schema: Literal[1]
    verdict: VerdictKind
    headline: str
    probability: Chance
    probability_of: str | None
    advice: tuple[str, ...]
    sentences: tuple[str, ...]
    simulated: tuple[str, ...]
    causes: tuple[CauseEntry, ...]
    formula: FormulaEntry | None
    leftover: Chance
    heldout: HeldoutEntry
    next_push: NextPushEntry | None
    limits: tuple[LimitEntry, ...]
    ranking: tuple[CauseEntry, ...]
    power: tuple[PowerEntry, ...]
    amount: AmountEntry
    spent_s: tuple[SpentEntry, ...]


def json_schema() -> str:
    """The JSON Schema of a `VerdictFile`, as in docs/verdict.schema.json."""
    made = {"$schema": _DIALECT, **msgspec.json.schema(VerdictFile)}
    written = msgspec.json.format(msgspec.json.encode(made), indent=2).decode()
    return re.sub(r"(\\n\s*)+", " ", written) + "\n"
