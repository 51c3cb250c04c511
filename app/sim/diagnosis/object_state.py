"""Object state: of whichever engine simulates the object."""

from typing import TypeAlias

from app.sim.rods.state import RodState
from app.sim.state import State

ObjectState: TypeAlias = State | RodState
"""State with the positions of particles `x` (B, N, 3) [m], the nodes of a rope `centreline` (B, 2, n) [m] (of others
n = 0), and `resting`."""
