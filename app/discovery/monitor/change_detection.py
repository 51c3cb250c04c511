"""While pushes are made: is the model still right? A sequential test that may be looked at after every push.

Both of its parts bet on how often a push ends beyond a band, and win where that is more often than it may be:

- *As at first*: the band is the largest of the first errors. Where errors are as likely in one order as in any other,
  as they are where nothing changes, the next one is beyond it with probability (1 + k) / (1 + n), after n errors of
  which k were, whatever their distribution, heavy tails included (exceedances: Gumbel and von Schelling 1950, "The
  distribution of the number of exceedances").
- *As promised*: the band is `BAND` times the error that the model said it would make, beyond which one push in
  `1 / BEYOND` may end. A model that says nothing has no such band.

Each is a test martingale: what is bet on a right model grows to 2/a ever with probability a/2 at most (Ville 1939; see
Ramdas, Grunwald, Vovk and Shafer 2023, "Game-theoretic statistics and safe anytime-valid inference"). So an alarm is
false with probability a at most, however long the session and however often one looks. Of each bet a share is spread
anew at every push, so that a change is met whenever it comes (Herbster and Warmuth 1998, "Tracking the best expert").

Without a promise, no test at all can be quick: n right pushes and k that are all worse are one order of (n + k) over k.
"""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.discovery.monitor.push_residual import Glance

FALSE_ALARM = 0.01
"""Probability of ever raising a false alarm in a session."""
FIRST = 8
"""Pushes whose errors make the first band."""
BAND = 2.5
BEYOND = 0.1
"""Exponentially distributed errors with the promised mean are beyond the band in 8 % of pushes."""

_BELIEFS = (0.5, 0.8, 0.95)
"""Rates at which a wrong model's pushes may end beyond a band, as alternatives."""
_SPREAD = (0.4, 0.2, 0.2, 0.2)
"""Split of a bet at first and in each renewal: a reserve, then a part for each belief."""
_ANEW = 0.05
"""The share that is spread anew."""
_TESTS = 2

Capital: TypeAlias = tuple[float, ...]
"""The reserve, and the wealth of each belief. Their sum, initially 1, is the evidence against the model (e-process)."""
State: TypeAlias = Literal["learning", "right", "wrong"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """State of the sequential test of a model; `after` gives the next one.

    `false_alarm`: the rate that is kept. `evidence`: after each push, the larger of both tests' as a share of what it
    takes for an alarm. `alarmed`: the push that raised the alarm, counted from 1; 0 where none did. `band` holds the
    largest of the first scores, `beyond` counts the later ones above it.
    """

    false_alarm: float = FALSE_ALARM
    glances: tuple[Glance, ...] = ()
    evidence: tuple[float, ...] = ()
    alarmed: int = 0
    band: float = 0.0
    beyond: int = 0
    as_first: Capital = _SPREAD
    as_promised: Capital = _SPREAD

    def after(self, glance: Glance) -> "Watch":
        """The watch once a push has been seen; one without a finite error is left out."""
        score, count = glance.score, len(self.glances)
        if not math.isfinite(score):
            return self
        first, promised = self.as_first, self.as_promised
        beyond = count >= FIRST and score > self.band
        if count >= FIRST:
            first = _bet(first, beyond, expected=(1 + self.beyond) / (1 + count))
        if math.isfinite(glance.promised_m):
            promised = _bet(promised, glance.error_m > BAND * glance.promised_m, expected=BEYOND)
        evidence = max(sum(first), sum(promised)) * self.false_alarm / _TESTS
        return Watch(
            false_alarm=self.false_alarm,
            glances=(*self.glances, glance),
            evidence=(*self.evidence, evidence),
            alarmed=self.alarmed or (count + 1 if evidence >= 1 else 0),
            band=self.band if count >= FIRST else max(self.band, score),
            beyond=self.beyond + beyond,
            as_first=first,
            as_promised=promised,
        )

    @property
    def state(self) -> State:
        """`learning`: nothing could have been noticed yet."""
        if self.alarmed:
            return "wrong"
        promised = any(math.isfinite(glance.promised_m) for glance in self.glances)
        return "right" if promised or len(self.glances) > FIRST else "learning"

    @property
    def since(self) -> int:
        """The push from which on the model seems to be wrong, counted from 1; 0 while there is no alarm.

        That after the last of the pushes before the alarm at which the evidence was least, as in a CUSUM chart (Page
        1954, "Continuous inspection schemes").
        """
        if not self.alarmed:
            return 0
        before = [self.false_alarm / _TESTS, *self.evidence[: self.alarmed - 1]]
        return max(number for number, evidence in enumerate(before) if evidence == min(before)) + 1

    @property
    def pushes_in_doubt(self) -> tuple[Glance, ...]:
        """The pushes since the model seems to be wrong."""
        return self.glances[self.since - 1 :] if self.since else ()


def _bet(capital: Capital, beyond: bool, *, expected: float) -> Capital:
    """The capital after a push that ended beyond a band or not, as a right model's does with probability `expected`.

    A share is spread anew; what is held back then gains nothing, each belief what it said over what was expected.
    """
    whole, said = _ANEW * sum(capital), (expected, *_BELIEFS)
    gains = [belief / expected if beyond else (1 - belief) / (1 - expected) for belief in said]
    parts = zip(capital, _SPREAD, gains, strict=True)
    return tuple(((1 - _ANEW) * part + whole * share) * gain for part, share, gain in parts)
