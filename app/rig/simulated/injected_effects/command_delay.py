"""Command delay: the arm executes everything d later than commanded, and its encoders show it."""

from app.core.geometry.track import Track
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, InjectedParameter, Values, plain


def _drive(track: Track, values: Values) -> Track:
    return Track(times_s=track.times_s + values[0], poses=track.poses)


HIDDEN = Hidden(
    family="actuation",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="command_delay", unit="s", typical=0.1, high=0.5),),
    draw=plain,
    drive=_drive,
    told=True,
)
