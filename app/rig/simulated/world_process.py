"""The world's own process: the arm's tool moves the object, in real time.

It processes the arm's log of states in order. Where it falls behind real time it catches up, tick by tick along the
same path, and the arm never waits for it; snapshots carry the arm's time.
"""

import os
import time
from typing import Any, final

import numpy as np

from app.arm.memory import ArmMemory
from app.core.geometry.scene_description import Stage
from app.core.system.ring import Ring
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Nodes, Snapshot, World

_CATCH_UP_TICKS = 20


def snapshot_ring(stage: Stage) -> Ring:
    """Ring of the last snapshots of a world of this stage."""
    count = kind_of(stage).node_count(stage)
    return Ring(np.dtype([("time_s", "f8"), ("tool", "f8", (8,)), ("nodes", "f8", (count, 3))]), 16)


def newest_snapshot(snapshots: Ring) -> Snapshot | None:
    """The last reported world, None before the first report; `time_s` is monotonic time."""
    record = snapshots.newest()
    if record is None:
        return None
    tool: np.ndarray = record["tool"]
    return Snapshot(time_s=float(record["time_s"]), nodes=record["nodes"], tool=tool, joints=solve_joints(tool))


def run_world(
    arm: ArmMemory,
    snapshots: Ring,
    stage: Stage,
    start: Nodes,
    period_s: float,
    parent: int,
) -> None:
    """Body of the process: follow the arm's states until closed or until `parent` is gone."""
    follower: WorldFollower | None = None
    while not arm.closing.value and os.getppid() == parent:
        if follower is None and arm.states.count:
            state = arm.states.newest()
            world = kind_of(stage).build(stage, start, 0.0)
            world.place(state["measured"])
            follower = WorldFollower(world, arm.states, snapshots, float(state["time_s"]))
        if follower is None or not follower.follow():
            time.sleep(period_s)


@final
class WorldFollower:
    """World that replays the arm's log."""

    def __init__(self, world: World, states: Ring, snapshots: Ring, start_s: float) -> None:
        self._world, self._states, self._snapshots, self._start_s = world, states, snapshots, start_s
        self._done = states.count

    def follow(self) -> bool:
        """Step through some of the new states; True where more are waiting."""
        todo: Any = self._states.since(self._done)[:_CATCH_UP_TICKS]
        for state in todo:
            due_s = float(state["time_s"]) - self._start_s - self._world.time_s
            self._world.step(state["measured"], max(due_s, 0.0))
        self._done += len(todo)
        if len(todo):
            self._snapshots.append(time_s=float(todo[-1]["time_s"]), tool=self._world.tool, nodes=self._world.nodes())
        return len(todo) == _CATCH_UP_TICKS
