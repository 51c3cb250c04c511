"""Camera time offset: images are taken later than their stamps say, or earlier."""

from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, InjectedParameter, Values, with_random_sign


def _late_s(values: Values) -> float:
    return float(values[0])


HIDDEN = Hidden(
    family="sensing",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="camera_time_offset", unit="s", typical=0.03, high=0.2),),
    draw=with_random_sign,
    late_s=_late_s,
)
