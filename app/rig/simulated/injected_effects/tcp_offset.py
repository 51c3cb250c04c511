"""Tool-centre-point offset: the tool's tip is t beside its position by the kinematics, and turns with the tool."""

from scipy.spatial.transform import Rotation

from app.core.geometry.track import Track
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, Values, components, spatial


def _drive(track: Track, values: Values) -> Track:
    turns = Rotation.from_quat(track.poses[:, 3:7], scalar_first=True)
    return track.with_positions(track.positions + turns.apply(values))


HIDDEN = Hidden(
    family="sensing", bodies=ANY_BODY, quantities=components("tcp", "xyz", "m", 0.003, 0.02), draw=spatial, drive=_drive
)
