"""Fault injection for the emulated arm."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, kw_only=True)
class FaultInjection:
    """Injected faults; none by default.

    `delay_s`: delay of every answer; `lose_feedback`: of every so many answers over UDP one is sent, 0 for all; `loss`:
    probability of losing a datagram, or of delaying stream data until it is sent again; `deaf`: connections are
    accepted, and nothing is ever answered; `short_m`: a motion ends so far before its end and is reported as complete
    (ros_kortex #116); `foreign`: another session has control (#144); `thinks_s`: planning time of a trajectory before
    it begins (#258); `object_at`: closure in 0..1 at which the fingers meet something; `force_n`: upward force on the
    tool; `stuck`: the joints do not move, whatever the command; `tip_m`, `turn_deg`, `payload_kg`, `gravity_z`: the
    reported configuration, whatever it really is; `denies`: name of a call that is refused, for want of permission.
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
