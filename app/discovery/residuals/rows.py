"""Data of a linearised study: rows of residuals of each push, their slopes, and which of them belong together."""

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float64, Int


class Block(NamedTuple):
    """Rows whose errors belong together. `least_m` [m]: they are independent and no smaller; None: all is learnt.

    `reversed`: sign of each row where the object's other end is called the first; None: they do not change.
    """

    rows: slice
    least_m: float | None = None
    reversed: Float64[np.ndarray, " S"] | None = None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Data of K pushes: residuals (K, R) [m], slopes (K, R, P) [m a step], and random effects of each (K, R, D) [m].

    `spread`: its columns are independent errors of one standard deviation. `known`: mask of the observed rows; others
    do not count.
    """

    r: Float64[np.ndarray, "K R"]
    J: Float64[np.ndarray, "K R P"]
    spread: Float64[np.ndarray, "K R D"]
    known: Bool[np.ndarray, "K R"]
    episode: Int[np.ndarray, " K"]
    blocks: tuple[Block, ...]

    def __len__(self) -> int:
        return len(self.r)

    def without(self, episode: int) -> "Residuals":
        """The data of all episodes but one."""
        return self.of(self.episode != episode)

    def of(self, chosen: Bool[np.ndarray, " K"] | Int[np.ndarray, " L"]) -> "Residuals":
        """The data of some of the pushes."""
        return Residuals(
            r=self.r[chosen],
            J=self.J[chosen],
            spread=self.spread[chosen],
            known=self.known[chosen],
            episode=self.episode[chosen],
            blocks=self.blocks,
        )
