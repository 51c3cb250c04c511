"""Sanity checks of models: none that predicts no better than no motion, or worse than without a cause, may name one."""

from collections.abc import Iterator

import numpy as np

from app.discovery.dataset.names import motion_name
from app.discovery.dataset.object_kinds import ObjectTraits
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.results.case import Gain, Limit

_ENOUGH = 0.9
"""Share of the pushes that have to be simulated."""
_MM = 1e3


def model_limits(trials: SimulationBatch, data: Residuals) -> Iterator[Limit]:
    """Limits that forbid a name whatever the evidence; `data`: residuals of the refitted model."""
    simulated = np.any(data.known[:, trials.after_rows], axis=1)
    empty = trials.is_empty
    count, asked = int(simulated.sum()), int((~empty).sum())
    if len(data) and empty.all():
        yield Limit(
            text="No pour begins with anything in the held bowl.",
            consequence="Nothing can be said of pours: record some that begin with a bowl that is filled.",
            fatal=True,
        )
        return
    if count < _ENOUGH * asked:
        yield Limit(
            text=f"Only {count} of {asked} {motion_name(trials.kind.name, count=2)} could be simulated.",
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
                f"The refitted model errs by {_MM * errors.mean():.0f} {trials.kind.unit} a "
                f"{motion_name(trials.kind.name)}; one in which nothing moves errs by {_MM * moved.mean():.0f} "
                f"{trials.kind.unit}."
            ),
            consequence=(
                "No cause is named by a model that does not work: check the sizes of object and tool, and that both "
                "are in one frame and on one clock."
            ),
            fatal=True,
        )


def gain_limits(gain: Gain, kind: ObjectTraits, extension: str | None) -> Iterator[Limit]:
    """Limits that show in use, on episodes that were left out; `extension`: of the extended model, in words."""
    unit, motion = kind.unit, motion_name(kind.name)
    if extension is not None and gain.is_loss:
        yield Limit(
            text=(
                f"With {extension} the model errs by {gain.extended_mm:.1f} {unit} a {motion} on episodes that "
                f"it was not fitted to, without it by {gain.nominal_mm:.1f} {unit}."
            ),
            consequence=(
                "What fits and does not predict is no cause, so the model is left without it: check the sizes and the "
                "shapes of tool and object, and record further episodes."
            ),
        )
    elif gain.is_of_weak_model and gain.nominal_mm < gain.still_mm:
        yield Limit(
            text=(
                f"The refitted model errs by {gain.nominal_mm:.1f} {unit} a {motion} on episodes that it was not "
                f"fitted to; one in which nothing moves errs by {gain.still_mm:.1f} {unit}."
            ),
            consequence=(
                "It explains little of the motion, so only large effects show: check the sizes and the shapes of tool "
                "and object, and what the table is made of."
            ),
        )


def _moved_m(trials: SimulationBatch, k: int) -> float:
    """Root of the sum of squares of the amplitudes of what a push does to the object."""
    before = trials.clouds[k]
    return float(np.linalg.norm(trials.gap(k, "after", before, trials.observed.after[k])))
