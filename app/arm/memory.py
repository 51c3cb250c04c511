"""Shared memory of the application and an arm's process, and the encoding of its records."""

from typing import Any, Final, final

import numpy as np

from app.arm.gate import MAX_WAYPOINTS
from app.core.dialogue.jog import Jog
from app.core.motion import Motion
from app.core.system.ring import Ring, Stamp

MODES: Final = ("idle", "moving", "stopping", "stopped", "fault")
TEXT_BYTES: Final = 256

_STATE = np.dtype(
    [
        ("time_s", "f8"),
        ("period_s", "f8"),
        ("commanded", "f8", (8,)),
        ("measured", "f8", (8,)),
        ("velocity", "f8", (3,)),
        ("joints", "f8", (7,)),
        ("force", "f8", (3,)),
        ("mode", "i4"),
        ("motion", "i8"),
        ("reset_ns", "i8"),
        ("reason", f"S{TEXT_BYTES}"),
    ]
)
_MOTION = np.dtype(
    [
        ("waypoints", "i8"),
        ("digest", "S64"),
        ("turned", "?"),
        ("opened", "?"),
        ("continues", "?"),
        ("poses", "f8", (MAX_WAYPOINTS, 8)),
        ("speeds", "f8", (MAX_WAYPOINTS,)),
    ]
)
_JOG = np.dtype([("linear", "f8", (3,)), ("angular", "f8", (3,)), ("opening", "f8")])
_REFUSAL = np.dtype([("motion", "i8"), ("code", "S32"), ("reason", f"S{TEXT_BYTES}")])


@final
class ArmMemory:
    """Shared memory of the arm's process and the application.

    Written by the application: `motions` (number n is its n-th record), `keepalives` (a number that changes while the
    motion is supervised), `jogs` (the newest counts) and `accepts_jog` (jogs are accepted), `stop_ns` and `reset_ns`
    (monotonic time of the last request; a stop is in force while it is later than the last reset), `closing`. Written
    by the arm: `states`, one a tick, which name the motion begun last, and `refusals`.
    """

    def __init__(self) -> None:
        self.states = Ring(_STATE, 8192)
        self.motions = Ring(_MOTION, 2)
        self.refusals = Ring(_REFUSAL, 8)
        self.jogs, self.accepts_jog = Ring(_JOG, 64), Stamp()
        self.keepalives, self.stop_ns, self.reset_ns, self.closing = Stamp(), Stamp(), Stamp(), Stamp()


def encode_motion(motion: Motion) -> dict[str, object]:
    """Record of `motion` for `ArmMemory.motions`, without its digest."""
    rows = np.zeros((MAX_WAYPOINTS, 9))
    rows[: len(motion.positions)] = np.concatenate([motion.poses, motion.speeds[:, None]], axis=1)
    return {
        "waypoints": len(motion.positions),
        "turned": len(motion.turns) > 0,
        "opened": len(motion.openings) > 0,
        "continues": motion.continues,
        "poses": rows[:, :8],
        "speeds": rows[:, 8],
    }


def motion_of(request: Any) -> Motion:
    """Motion decoded from its record."""
    waypoints = int(request["waypoints"])
    poses = request["poses"][:waypoints]
    return Motion(
        positions=poses[:, :3].copy(),
        speeds=request["speeds"][:waypoints].copy(),
        turns=poses[:, 3:7].copy() if request["turned"] else np.zeros((0, 4)),
        openings=poses[:, 7].copy() if request["opened"] else np.zeros(0),
        continues=bool(request["continues"]),
    )


def jog_of(told: Any) -> Jog:
    """Velocity command decoded from its record."""
    return Jog(linear=told["linear"].copy(), angular=told["angular"].copy(), opening=float(told["opening"]))
