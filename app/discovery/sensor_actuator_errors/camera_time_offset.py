"""Camera time offset: an image shows what was d later than its time stamp says, x_observed(t) = x(t + d).

Clocks of camera and arm that disagree, exposure and transport times that nobody subtracted: 5 to 50 ms. What moves is
displaced by d times its velocity, the seen finger too; what rests is not.
"""

from app.discovery.sensor_actuator_errors.base import Apparatus, Values, one


def _late_s(values: Values) -> float:
    return float(values[0])


EFFECT = Apparatus(
    family="sensing",
    parameters=one("camera_time_offset", "s", 0.03, 0.2, "How much later than stamped images are.", least=-0.2),
    late_s=_late_s,
)
