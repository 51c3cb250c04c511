"""Object state: of whichever engine simulates the object."""

from typing import TypeAlias

from app.sim.rods.state import RodState
from app.sim.state import State

ObjectState: TypeAlias = State | RodState
"""Has the positions of particles `x` (B, N, 3) [m], and `resting`."""
