"""The simulated table: a rope that a finger pushes, in MuJoCo. No clock, no process: it is stepped."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.fixtures import Obstacle
from app.core.geometry.shapes.tools import Finger
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.bodies.rope_segments import RopeSegments
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.cable import Cable
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.engine import TOOL, advance, mujoco, new_spec
from app.rig.simulated.worlds.physics import HOME_TOOL_M, Centreline, Position, WorldPhysics
from app.rig.simulated.worlds.rope import FINGER_BIT, TABLE_BIT, Chain, RopeBody, about_z, resample
from app.rig.simulated.worlds.world import Snapshot

_PRESCRIBED_KG = 1000.0
"""Inertia of the finger's slides: so large that no contact changes their prescribed velocity."""


@final
class RopeWorld:
    """A rope on the table z = 0 and a vertical finger with a prescribed position of its tip.

    `centreline (K, 3)` [m]: initial centreline of the rope; the world keeps its own `physics.segments + 1` nodes. The
    effects of `intrusion` act in it; ValueError where one is in a cable. The same calls give the same numbers, bit for
    bit.
    """

    def __init__(
        self,
        rope: Rope,
        finger: Finger,
        centreline: Centreline,
        *,
        physics: WorldPhysics | None = None,
        tool: tuple[float, float, float] = HOME_TOOL_M,
        intrusion: Intrusion | None = None,
        time_s: float = 0.0,
        fixtures: Sequence[Obstacle] = (),
    ) -> None:
        self.intrusion = intrusion or Intrusion(())
        physics = self.intrusion.physics(physics or WorldPhysics(), rope)
        if physics.cable is not None and self.intrusion.hides:
            raise ValueError("Effects are hidden in a rope that is a chain, not in a cable; leave one out.")
        nodes = resample(centreline, physics.segments + 1)
        self._rope: RopeBody = (Chain if physics.cable is None else Cable)(rope, physics, nodes)
        self._model = _compile(self._rope, finger, physics, self.intrusion, fixtures)
        self._data = mujoco.MjData(self._model)
        self._rope.lay(self._model, self._data)
        self._bend = slice(3, int(self._model.body(TOOL).jntnum[0]))
        self._data.qpos[:3], self._data.time = tool, time_s
        mujoco.mj_forward(self._model, self._data)
        if self.intrusion.acts:
            links, rubbed = self._rope.links, self.intrusion.rubs
            self.intrusion.attach(RopeSegments(self._model, self._data, links, rope, finger, rubbed=rubbed))

    @property
    def time_s(self) -> float:
        """The world's own time [s], from `time_s`."""
        return float(self._data.time)

    @property
    def tool(self) -> ToolPose:
        """Commanded pose of the finger, which neither turns nor opens."""
        return pointing_down(self._data.qpos[:3])

    @property
    def tip(self) -> Position:
        """Actual tip of the finger [m]: the tool's position, unless it is compliant."""
        tip, bent = self._data.qpos[:3].copy(), self._data.qpos[self._bend]
        tip[: len(bent)] += bent
        return tip

    def step(self, tool: Float64[np.ndarray, " _"], duration_s: float) -> None:
        """Move the tip in a straight line to `tool` while `duration_s` passes (rounded to whole time steps).

        A finger uses only the position, the first three numbers of a pose.
        """
        period = self._model.opt.timestep
        start, steps = self._data.qpos[:3].copy(), max(1, round(duration_s / period))
        for step in range(1, steps + 1):
            due = start + (tool[:3] - start) * (step / steps)
            self._data.qvel[:3] = (due - self._data.qpos[:3]) / period
            self.intrusion.act()
            advance(self._model, self._data)

    def place(self, tool: Float64[np.ndarray, " _"]) -> None:
        """Move the tip to `tool` without contact on the way; no time passes."""
        self._data.qpos[:3] = tool[:3]
        self._data.qvel[:3] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def nodes(self) -> Centreline:
        """The rope's nodes [m], shape (segments + 1, 3)."""
        return self._rope.nodes()

    def snapshot(self) -> Snapshot:
        """The state to draw, with the arm's joints solved for the present tool pose."""
        tool = pointing_down(self.tip)
        return Snapshot(time_s=self.time_s, nodes=self.nodes(), tool=tool, joints=solve_joints(tool))


def _compile(
    rope: RopeBody,
    finger: Finger,
    physics: WorldPhysics,
    intrusion: Intrusion,
    fixtures: Sequence[Obstacle],
) -> Any:
    """The MuJoCo model: table, finger (its three slides are the first three coordinates), rope."""
    spec = new_spec(physics)
    # A rope at rest sleeps: it cannot creep and costs nothing.
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    _add_table(spec, physics)
    _add_finger(spec, finger, physics)
    rope.add(spec)
    for block in fixtures:
        _add_block(spec, block, physics)
    intrusion.build(spec, physics)
    return spec.compile()


def _add_block(spec: Any, block: Obstacle, physics: WorldPhysics) -> None:
    """Add a fixed obstacle."""
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=block.half_m,
        pos=block.place_m,
        contype=FINGER_BIT,
        conaffinity=FINGER_BIT,
        friction=[block.friction, 0.0, 0.0],
        solref=[physics.contact_time_s, 1.0],
        priority=1,
    )


def _add_table(spec: Any, physics: WorldPhysics) -> None:
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[2.0, 2.0, 0.1],
        contype=TABLE_BIT,
        conaffinity=TABLE_BIT,
        friction=[physics.table_friction, 0.0, 0.0],
        solref=[physics.contact_time_s, 1.0],
        priority=int(physics.cable is not None),
    )


def _add_finger(spec: Any, finger: Finger, physics: WorldPhysics) -> None:
    """Add its shape on three heavy slides, so that contacts see its true velocity (a mocap body's is zero)."""
    body = spec.worldbody.add_body(name=TOOL, gravcomp=1.0)
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=_PRESCRIBED_KG)
    for shape in (_round if finger.half_width_m == 0 else _plate)(finger, physics.finger_length_m):
        body.add_geom(
            **shape,
            contype=FINGER_BIT,
            conaffinity=FINGER_BIT,
            mass=1.0,
            friction=[physics.finger_friction, 0.0, 0.0],
            solref=[physics.contact_time_s, 1.0],
            # MuJoCo takes the larger friction of two geoms unless one of them has priority.
            priority=1,
        )


def _round(finger: Finger, length_m: float) -> list[dict[str, Any]]:
    """Geoms of a round finger: a capsule."""
    ends = [0, 0, finger.radius_m, 0, 0, length_m]
    return [{"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": [finger.radius_m, 0, 0], "fromto": ends}]


def _plate(finger: Finger, length_m: float) -> list[dict[str, Any]]:
    """Geoms of a plate with round edges: a capsule along its lower edge, and one up from each end of that."""
    (x0, y0, _), (x1, y1, _) = finger.ends_m()
    low_m, radius_m = finger.radius_m, finger.radius_m
    lines = [
        [x0, y0, low_m, x1, y1, low_m],
        [x0, y0, low_m, x0, y0, length_m],
        [x1, y1, low_m, x1, y1, length_m],
    ]
    return [
        *({"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": [radius_m, 0, 0], "fromto": line} for line in lines),
        {
            "type": mujoco.mjtGeom.mjGEOM_BOX,
            "size": [finger.half_width_m, radius_m, (length_m - low_m) / 2],
            "pos": [0.0, 0.0, (length_m + low_m) / 2],
            "quat": about_z(finger.yaw_rad),
        },
    ]
