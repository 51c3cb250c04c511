"""Quick diagnosis of a model whose pushes end elsewhere, as far as it goes without simulating.

The mean residual of each push is looked at in frames, as `frames.py` does it with whole displacement fields, and
against the arm's own log. A suspicion has no error rate: to know, `dipac discover` fits the causes themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.discovery.monitor.push_residual import Glance

Kin: TypeAlias = Literal["sensing", "actuation", "contact or table", "material", "time"]

_LEAST = 3
"""Pushes before anything is suspected."""
_ENOUGH = 0.5
"""The share of the mean residuals' square that a pattern has to explain."""
_STRAYED_M = 1.5e-3
"""An arm that follows its commands within this is not suspected: the simulated one does within a millimetre."""
_LATE_S = 0.25
"""A log that is later than this is worth a word; a position control of an arm lags by a tenth of a second."""
_SMALL = 0.35
"""Mean residuals that are this share of the errors are no displacement of the whole object."""
_CHANGING = 0.15
"""The share of the residuals' square that has to be change between pushes: a steady growth from nothing makes 0.25."""
_MM, _MS = 1e3, 1e3

Vectors: TypeAlias = Float64[np.ndarray, "K 2"]


@final
@dataclass(frozen=True, kw_only=True)
class Suspicion:
    """Kind of the likely error, its evidence in words, and the share of the residuals that it explains."""

    kin: Kin
    text: str
    explained: float


def suspect(glances: Sequence[Glance]) -> tuple[Suspicion, ...]:
    """Patterns in the residuals of these pushes, the most telling first; empty for none, or too few pushes."""
    if len(glances) < _LEAST:
        return ()
    residuals = np.stack([glance.residual_m for glance in glances])
    errors = np.array([glance.error_m for glance in glances])
    found = [_late(glances)]
    if np.sqrt((residuals**2).sum(1).mean()) < _SMALL * np.sqrt((errors**2).mean()):
        text = "the object ends where it is predicted as a whole, and in another shape"
        found.append(Suspicion(kin="material", text=text, explained=1.0))
    else:
        found += [
            _arm(glances, residuals),
            *_frames(glances, residuals),
            _time(glances, residuals),
            _place(glances, residuals),
        ]
    return tuple(sorted((it for it in found if it and it.explained >= _ENOUGH), key=lambda it: -it.explained))


def _late(glances: Sequence[Glance]) -> Suspicion | None:
    """Delay of the arm's log behind its command: measured directly, whatever the residuals."""
    late_s = float(np.median([glance.late_s for glance in glances]))
    if late_s < _LATE_S:
        return None
    return Suspicion(kin="actuation", text=f"the arm is {late_s * _MS:.0f} ms behind its command", explained=1.0)


def _arm(glances: Sequence[Glance], residuals: Vectors) -> Suspicion | None:
    """Offset of the tip from its command, by the arm's own log."""
    strayed = np.stack([glance.strayed_m for glance in glances])
    length_m = float(np.linalg.norm(strayed, axis=1).mean())
    if length_m < _STRAYED_M:
        return None
    # How much the object moves for each millimetre of the tip depends on the push: one factor for all of them.
    factor = max(float((residuals * strayed).sum() / (strayed**2).sum()), 0.0)
    explained = 1 - float(((residuals - factor * strayed) ** 2).sum() / (residuals**2).sum())
    text = f"the arm's own log ends {length_m * _MM:.1f} mm off its command, and so does the object"
    return Suspicion(kin="actuation", text=text, explained=explained)


def _frames(glances: Sequence[Glance], residuals: Vectors) -> list[Suspicion]:
    """Constant residual on the table, or along and across the push. The tool never turns: its frame is the table's."""
    along = _along(glances, residuals)
    x, y = residuals.mean(0) * _MM
    forth, left = along.mean(0) * _MM
    kin: Kin = "contact or table"
    way = f"{abs(forth):.1f} mm {'farther' if forth > 0 else 'less far'} along the push than predicted"
    if abs(left) > abs(forth):
        kin, way = "actuation", f"{abs(left):.1f} mm to the {'left' if left > 0 else 'right'} of the push"
    return [
        Suspicion(
            kin="sensing",
            text=f"the object ends ({x:+.1f}, {y:+.1f}) mm away in x and y, whichever way it is pushed, as with "
            "cameras or a tool that are elsewhere than thought, or a tilted table",
            explained=_constant(residuals),
        ),
        Suspicion(kin=kin, text=f"the object ends {way}", explained=_constant(along)),
    ]


def _time(glances: Sequence[Glance], residuals: Vectors) -> Suspicion:
    """Growth of the residual from push to push, on the table or along the push."""
    order = np.arange(len(residuals), dtype=np.float64)[:, None]
    growing = max(_slope(order, residuals), _slope(order, _along(glances, residuals)))
    text = "the object ends farther away from push to push, as with something that wears, warms or drifts"
    return Suspicion(kin="time", text=text, explained=growing)


def _place(glances: Sequence[Glance], residuals: Vectors) -> Suspicion:
    """Dependence of the residual on the place on the table, along x and y."""
    places = np.stack([glance.place_m for glance in glances])
    text = "where the object ends is wrong by more in some places than in others"
    return Suspicion(kin="contact or table", text=text, explained=_slope(places, residuals))


def _along(glances: Sequence[Glance], residuals: Vectors) -> Vectors:
    """Residuals along each push, and to its left."""
    ahead = np.stack([glance.ahead for glance in glances])
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    return np.stack([(residuals * ahead).sum(1), (residuals * across).sum(1)], axis=1)


def _constant(turned: Vectors) -> float:
    """The square of the mean over the mean of squares, less what chance makes of so many pushes (as `frames.py`)."""
    whole = float((turned**2).sum(1).mean())
    raw = float((turned.mean(0) ** 2).sum()) / max(whole, 1e-12)
    return max(0.0, (len(turned) * raw - 1) / (len(turned) - 1))


def _slope(places: Float64[np.ndarray, "K C"], residuals: Vectors) -> float:
    """The share of the change between residuals that straight lines explain, adjusted for their number.

    None where residuals hardly change, or a line would go through them anyway.
    """
    apart, change = places - places.mean(0), residuals - residuals.mean(0)
    count, free = len(residuals), len(residuals) - places.shape[1] - 1
    whole = float((change**2).sum())
    if free < _LEAST or whole < _CHANGING * float((residuals**2).sum()):
        return 0.0
    left = change - apart @ np.linalg.lstsq(apart, change, rcond=None)[0]
    return max(0.0, 1 - float((left**2).sum()) / whole * (count - 1) / free)
