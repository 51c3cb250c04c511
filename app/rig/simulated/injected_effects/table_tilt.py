"""Table tilt: gravity leans by a about x and by b about y, so that weight pulls along the table.

The world's gravity vector itself is turned; its length stays.
"""

from typing import Any

import numpy as np

from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, Values, components, level
from app.rig.simulated.worlds.physics import WorldPhysics


def _build(spec: Any, physics: WorldPhysics, values: Values) -> None:
    a, b = np.sin(np.radians(values))
    spec.option.gravity = physics.gravity_m_s2 * np.array([b, -a, -np.sqrt(1.0 - a * a - b * b)])


HIDDEN = Hidden(
    family="physics", bodies=ANY_BODY, quantities=components("tilt", "xy", "deg", 1.0, 5.0), draw=level, build=_build
)
