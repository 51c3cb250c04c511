"""The dead-man: the tool moves while a control is held and the page is heard, and never again without a new press.

A pure state machine. Times are those of reception, on this machine's clock; a page's own times do not count.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, final

from app.teleop.sample import Sample

GAP_S: Final = 0.150
"""Longest gap between samples that come 33 ms apart; a hidden tab, a frozen page or a stuck network exceeds it."""
LONGEST_HOLD_S: Final = 30.0
AGAIN: Final = "release and press again"


@final
@dataclass(frozen=True, kw_only=True)
class DeadMan:
    """One page's dead-man, off at first. `why`: reason for being off, in words.

    `pressed` and `sequence` are the greatest numbers received; `since_s` is the start of the live press.
    """

    live: bool = False
    why: str = AGAIN
    pressed: int = 0
    sequence: int = -1
    heard_s: float = -math.inf
    since_s: float = -math.inf

    def after(self, sample: Sample, now_s: float) -> "DeadMan":
        """State after receiving `sample` at `now_s` [s]; unchanged by a late or repeated one."""
        if sample.sequence <= self.sequence:
            return self
        fresh, gap_s = sample.pressed > self.pressed, now_s - self.heard_s
        heard = replace(self, pressed=max(self.pressed, sample.pressed), sequence=sample.sequence, heard_s=now_s)
        if not sample.held:
            return heard.off("released")
        if fresh:
            return replace(heard, live=True, why="", since_s=now_s)
        if self.live and not 0 <= gap_s <= GAP_S:
            return heard.off(f"nothing was heard for {1e3 * gap_s:.0f} ms: {AGAIN}")
        if self.live and now_s - self.since_s > LONGEST_HOLD_S:
            return heard.off(f"held for {LONGEST_HOLD_S:.0f} s: {AGAIN}")
        return heard

    def off(self, why: str) -> "DeadMan":
        """Switched off until a new press."""
        return replace(self, live=False, why=why)
