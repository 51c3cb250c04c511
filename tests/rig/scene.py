"""A rope and a finger as tests of the rig use them, and motions that an operator has approved."""

import numpy as np

from app.core.dialogue.approval import Approved
from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.tools import Finger
from app.core.motion import Motion
from bench.approval import approved as approved_over

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.08, colour=(0.9, 0.25, 0.08))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)
PUSH_Z = FINGER.push_height_m


def straight_rope(x_m: float = 0.50) -> np.ndarray:
    """A centreline along y through (x, 0)."""
    y = np.linspace(-ROPE.length_m / 2, ROPE.length_m / 2, 81)
    return np.stack([np.full_like(y, x_m), y, np.full_like(y, ROPE.radius_m)], axis=1)


def push(start: tuple[float, float], end: tuple[float, float], speed_m_s: float = 0.2) -> Motion:
    """A straight push at the finger's push height."""
    return Motion(positions=np.array([[*start, PUSH_Z], [*end, PUSH_Z]]), speeds=np.full(2, speed_m_s))


def approved(motion: Motion) -> Approved:
    """`motion`, shown to and approved by an operator who sees a straight rope."""
    return approved_over(motion, straight_rope().astype(np.float32))
