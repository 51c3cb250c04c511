"""Fill level: the held bowl has more liquid in it at first than was said, by a share of all of it (negative: less).

Nobody sees it: a reconstruction takes for held what is missing of the volume that it is told. A fuller bowl spills at
less of a lean, and each level that is seen after it is higher by what was too much, first and last.
"""

from app.discovery.sensor_actuator_errors.base import Apparatus, Values, one
from app.sim.effects.base import LIQUIDS


def _more(values: Values) -> float:
    return float(values[0])


EFFECT = Apparatus(
    family="sensing",
    objects=LIQUIDS,
    parameters=one(
        "fill_level",
        "1",
        0.1,
        0.3,
        "Liquid beyond what was said, as a share of that.",
        least=-0.3,
        null_prior=(0.0, 0.3),
        liquid_null_prior=(0.04, 0.14),
    ),
    more=_more,
)
