"""Adhesion: the tool pulls back what parts from it, with a traction s on their contact patch.

The patch of a segment or a bean is its length times its diameter; it lets go 2 mm from the tool.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import (
    ON_TABLES_OR_POURED,
    Hidden,
    InjectedParameter,
    Moment,
    Values,
    Vectors,
    plain,
)

_REACH_M = 0.002


def _force(moment: Moment, values: Values) -> Vectors:
    parting = ((moment.tool_v - moment.v) * moment.toward).sum(1) > 0
    holds = parting & (moment.gap_m < _REACH_M)
    patch_m2 = moment.length_m * 2 * moment.radius_m
    return values[0] * patch_m2 * np.where(holds, 1.0, 0.0)[:, None] * moment.toward


HIDDEN = Hidden(
    family="physics",
    bodies=ON_TABLES_OR_POURED,
    liquid_share=12.0,
    quantities=(InjectedParameter(name="adhesion", unit="Pa", typical=41.7, high=166.0),),
    draw=plain,
    force=_force,
)
