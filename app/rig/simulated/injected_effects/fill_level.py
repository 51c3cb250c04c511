"""Fill level: the held bowl has so much more or less liquid in it at first, as a share of what its task says."""

from app.rig.simulated.injected_effects.base import LIQUIDS, Hidden, InjectedParameter, Values, with_random_sign


def _more(values: Values) -> float:
    return float(values[0])


HIDDEN = Hidden(
    family="sensing",
    bodies=LIQUIDS,
    quantities=(InjectedParameter(name="fill_level", unit="1", typical=0.1, high=0.3),),
    draw=with_random_sign,
    more=_more,
)
