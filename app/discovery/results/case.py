"""Results of discovery, and everything that a reader needs to judge them: the typed results of all stages.

Values are real ones in SI units (`ParameterSpec.real`), whatever the simulation's time scale. Intervals are 90 %.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.dialogue.model_monitor_messages import VerdictKind
from app.core.geometry.track import Track
from app.core.measured_setup import MeasuredSetup
from app.core.types import Points
from app.discovery.dataset.model_under_test import Family, Theta
from app.discovery.residuals.sensitivity import Step
from app.sim.effects.base import ObjectKind

_LOSS = 0.5
"""Share of the explained motion that a loss takes away. An arm's error that its log shows may cost a tenth more by
chance, as pushes are chaotic."""
_WEAK = 0.6
"""Share of the error of no motion above which a model explains little."""


@final
@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number with its interval: a parameter, the size of a cause, or a direct measurement without simulation.

    `null`: its value where nothing is wrong; that of a parameter is where its effect vanishes.
    """

    name: str
    about: str
    value: float
    unit: str
    low: float
    high: float
    null: float

    @property
    def holds_null(self) -> bool:
        """True if the null value lies in the interval."""
        return self.low <= self.null <= self.high


@final
@dataclass(frozen=True, kw_only=True)
class CauseResult:
    """A cause, its size, and the probability that it is missing in the model."""

    effect: str
    family: Family
    about: str
    estimates: tuple[Estimate, ...]
    probability: float
    log_bayes: float


@final
@dataclass(frozen=True, kw_only=True)
class Gain:
    """One-step errors [mm] on episodes that the models were not fitted to, and the share of the error that is gone.

    `nominal` is the refitted nominal model; `still` says that nothing moves. `low` and `high` are of the gain; all
    three are NaN where the nominal model has no error.
    """

    still_mm: float
    nominal_mm: float
    extended_mm: float
    gain: float
    low: float
    high: float
    episodes: int

    @property
    def is_loss(self) -> bool:
        """True if the extended model surely loses most of what the nominal one explains of the motion."""
        lost_mm, explained_mm = self.extended_mm - self.nominal_mm, self.still_mm - self.nominal_mm
        return lost_mm > max(_LOSS * explained_mm, 0.0) and not self.high >= 0  # NaN where the nominal has no error.

    @property
    def is_of_weak_model(self) -> bool:
        """True if neither model explains much of what moves."""
        return min(self.nominal_mm, self.extended_mm) > _WEAK * self.still_mm


@final
@dataclass(frozen=True, kw_only=True)
class Limit:
    """A deficiency of these data, and the conclusion that it prevents. A `fatal` one forbids to name any cause."""

    text: str
    consequence: str
    fatal: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ResidualField:
    """Residual displacements of the object about the refitted nominal model: places and displacements [m] (M, 2).

    `push`: index of each one's push; `along`: place along the object, -1 to 1; 0 of loose pieces.
    """

    places: Float32[np.ndarray, "M 2"]
    displacements: Float32[np.ndarray, "M 2"]
    push: Float32[np.ndarray, " M"]
    along: Float32[np.ndarray, " M"]


@final
@dataclass(frozen=True, kw_only=True)
class FrameTest:
    """The share of the mean residual's variance that is constant in a frame."""

    frame: str
    about: str
    explained: float
    low: float
    high: float


@final
@dataclass(frozen=True, kw_only=True)
class Power:
    """The smallest size of a cause that these data would have shown; infinite where they cannot show it."""

    effect: str
    parameter: str
    least: float
    typical: float
    unit: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Example:
    """A held-out push: before, observed, and as both models predict it, with the tool's way (T, 3) [m]."""

    number: int
    before: Points
    observed: Points
    nominal: Points
    extended: Points
    tool: Float64[np.ndarray, "T 3"]


@final
@dataclass(frozen=True, kw_only=True)
class Term:
    """One term of a force field that was found: its formula in symbols, and its meaning in words."""

    formula: str
    words: str
    estimates: tuple[Estimate, ...]


@final
@dataclass(frozen=True, kw_only=True)
class Formula:
    """A force on the object that no cause of the catalogue is: a share of weight, as a sum of terms.

    x [m] and v [m/s] are a point of the object and its velocity on the table, n points up, t is as in a session.
    """

    text: str
    words: str
    terms: tuple[Term, ...]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class NextPush:
    """The push that would best discriminate the remaining hypotheses: its track, and each model's prediction."""

    track: Track
    between: tuple[str, ...]
    apart_mm: float
    before: Points
    ends: tuple[Points, ...]
    text: str


@final
@dataclass(frozen=True, kw_only=True)
class Amount:
    """Amount of data."""

    task: str
    episodes: int
    pushes: int
    during: int
    measured: int
    particles: int


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """The whole case file.

    `causes` are those of the verdict: one or more that act together where it is `named`, the alternatives where it is
    a `set`. `ranking` is everything that was weighed. `confusions[i][j]`: how often `confused[i]`, hidden in these
    very pushes, would have been taken for `confused[j]`. `about`: the refitted nominal model; `extended`: what is
    saved, and `estimated` the steps in which it was fitted, with their `covariance`. `per_episode`: one-step errors
    [mm] (E, 2), nominal and extended; `steps`: the same over 1, 2, ... pushes, of a liquid over 1 alone.
    `spent_s`: seconds by stage.
    """

    amount: Amount
    limits: tuple[Limit, ...]
    checks: tuple[Estimate, ...]
    verdict: VerdictKind
    sentences: tuple[str, ...]
    causes: tuple[CauseResult, ...]
    formula: Formula | None
    ranking: tuple[CauseResult, ...]
    leftover: float
    """Probability that something acts which the causes of the verdict do not say; NaN where it was not looked for."""
    confused: tuple[str, ...]
    confusions: Float64[np.ndarray, "C C"]
    arrows: ResidualField
    frames: tuple[FrameTest, ...]
    gain: Gain
    per_episode: Float64[np.ndarray, "E 2"]
    steps: Float64[np.ndarray, "S 2"]
    examples: tuple[Example, ...]
    powers: tuple[Power, ...]
    next_push: NextPush | None
    nominal: tuple[Estimate, ...]
    about: Theta
    extended: Theta
    estimated: tuple[Step, ...]
    covariance: Float64[np.ndarray, "Q Q"]
    spent_s: tuple[tuple[str, float], ...]
    setup: MeasuredSetup | None = None
    """Object, tool and table as they were simulated, with the sources of their sizes."""
    kind: ObjectKind = "rope"
    """Kind of the object. Errors of a liquid, in mm, are hundredths of it (`poured_contents`)."""
    origin_m: tuple[float, float] = (0.0, 0.0)
    """Origin of `about` and `extended` in the frame of the data, which all else is in."""
