"""Residuals and slopes of pours: every simulation as the contents of the bowls, of which means and differences are."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, Float64

from app.discovery.dataset.bowls import PouredBowls
from app.discovery.residuals.poured_contents import CONTENTS, contents_m
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.residuals.simulation_batch import PushParticles, SimulationBatch


def assemble_contents(
    trials: SimulationBatch,
    bowls: PouredBowls,
    base: PushParticles,
    ends: Sequence[tuple[PushParticles, PushParticles]],
    apart: Sequence[float],
    replicas: Sequence[PushParticles],
) -> Residuals:
    """Residuals of the view after each pour, slopes of each change, and what disturbed beginnings do.

    `base`: the model's predictions; `ends`: those of both ends of each change, so many steps `apart`; `replicas`: the
    model's from beginnings that are disturbed, of all of which, and the base, the prediction is the mean. The view
    during a pour is not compared, nor are pours in which nothing is held.
    """
    count, rows = len(trials), slice(CONTENTS, 2 * CONTENTS)
    r, known = np.zeros((count, 2 * CONTENTS)), np.zeros((count, 2 * CONTENTS), bool)
    J = np.zeros((count, 2 * CONTENTS, len(ends)))
    spread = np.zeros((count, 2 * CONTENTS, len(replicas)))
    scale = np.array([1 / steps if steps > 0 else 0.0 for steps in apart])
    seen = _contents(bowls, trials.observed.after)
    empty = trials.is_empty
    every = np.stack([_contents(bowls, one.after) for one in (base, *replicas)])
    sides = [[_contents(bowls, side.after) for side in pair] for pair in ends]
    for k in range(count):
        simulated = np.isfinite(every[:, k]).all(1)
        if not simulated.any() or empty[k]:
            continue
        predicted = every[simulated, k].mean(0)
        r[k, rows], known[k, rows] = seen[k] - predicted, True
        if sides:
            J[k, rows] = np.stack([np.nan_to_num(up[k] - down[k]) for up, down in sides], axis=1) * scale
        if replicas:
            disturbed = np.nan_to_num(every[1:, k] - predicted)
            spread[k, rows] = disturbed.T / np.sqrt(len(replicas))
    return Residuals(
        r=r,
        J=J,
        spread=spread,
        known=known,
        episode=np.array([push.episode for push in trials.study.pushes]),
        blocks=(Block(slice(0, 2 * CONTENTS)),),
    )


def _contents(bowls: PouredBowls, clouds: Float32[np.ndarray, "K N 3"]) -> Float64[np.ndarray, "K R"]:
    return np.stack([contents_m(bowls, cloud) for cloud in clouds])
