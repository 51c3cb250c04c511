"""What may go wrong, switched on by whoever runs the arm that is not there."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, kw_only=True)
class Adversity:
    """All that is not as it should be; nothing of it by default.

    `delay_s`: every answer is late by this; `lose_feedback`: of every so many answers over UDP one is sent, 0 for
    all; `loss`: such a share of what is sent is lost, datagrams for good, on the stream until it is sent again;
    `deaf`: connections are accepted, and nothing is ever answered; `short_m`: a motion ends so far before its
    end and is reported as complete (ros_kortex #116); `foreign`: another session has control (#144); `thinks_s`: a
    trajectory is computed for so long before it begins (#258); `object_at`: the fingers meet something when closed
    so far, of 1; `force_n`: something pushes at the tool, upwards; `stuck`: the joints do not move, whatever they
    are told; `tip_m`, `turn_deg`, `payload_kg`, `gravity_z`: what the arm says is configured, whatever it holds and
    however it stands; `denies`: the call of this name is refused, for want of a right to it.
    """

    delay_s: float = 0.0
    lose_feedback: int = 0
    loss: float = 0.0
    deaf: bool = False
    short_m: float = 0.0
    foreign: bool = False
    thinks_s: float = 0.05
    object_at: float = 1.0
    force_n: float = 0.0
    stuck: bool = False
    tip_m: float = 0.120
    turn_deg: float = 0.0
    payload_kg: float = 0.0
    gravity_z: float = -9.81
    denies: str = ""
