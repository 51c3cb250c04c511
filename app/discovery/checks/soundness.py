"""Sanity check of the model under test: none that is no better than no motion may name a cause."""

from collections.abc import Iterator

import numpy as np

from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.results.case import Limit

_ENOUGH = 0.9
"""Share of the pushes that have to be simulated."""
_MM = 1e3


def model_limits(trials: SimulationBatch, data: Residuals) -> Iterator[Limit]:
    """Limits that forbid a name whatever the evidence; `data`: residuals of the refitted nominal model."""
    simulated = np.any(data.known[:, trials.after_rows], axis=1)
    count = int(simulated.sum())
    if count < _ENOUGH * len(data):
        yield Limit(
            text=f"Only {count} of {len(data)} pushes could be simulated.",
            consequence=(
                "What the others would say is unknown, so no cause is named: see that tool and object stay within 2 m "
                "of where they began, and that their sizes are right."
            ),
            fatal=True,
        )
    if not count:
        return
    errors = np.sqrt((data.r[simulated][:, trials.after_rows] ** 2).sum(1))
    moved = np.array([_moved_m(trials, int(k)) for k in np.flatnonzero(simulated)])
    if errors.mean() >= moved.mean():
        yield Limit(
            text=(
                f"The refitted model errs by {_MM * errors.mean():.0f} mm a push; one in which nothing moves errs by "
                f"{_MM * moved.mean():.0f} mm."
            ),
            consequence=(
                "No cause is named by a model that does not work: check the sizes of object and tool, and that both "
                "are in one frame and on one clock."
            ),
            fatal=True,
        )


def _moved_m(trials: SimulationBatch, k: int) -> float:
    """Root of the sum of squares of the amplitudes of what a push does to the object."""
    before = trials.clouds[k]
    return float(np.linalg.norm(trials.gap(k, "after", before, trials.observed.after[k])))
