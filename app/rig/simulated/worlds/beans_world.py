"""The simulated table with loose beans that a paddle sweeps, in MuJoCo. No clock, no process: it is stepped."""

from typing import Any, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import Beans
from app.core.geometry.shapes.tools import Paddle
from app.core.motion import TOOL_DOWN, pointing_down
from app.core.types import ToolPose
from app.rig.simulated.bodies.loose_beans import LooseBeans
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.engine import TOOL, advance, mujoco, new_spec
from app.rig.simulated.worlds.physics import BEAN_WORLD, HOME_TOOL_M, WorldPhysics
from app.rig.simulated.worlds.world import Nodes, Snapshot

_PRESCRIBED = 1000.0
"""Inertia of the paddle's joints [kg, kg m^2]: so large that no contact changes its prescribed velocity."""
_POSE = slice(0, 7)
"""Coordinates of the paddle, the first of the model: its slides, then its ball joint's quaternion."""
_SPEED = slice(0, 6)
_TABLE = "table"
_TABLE_BIT, _PADDLE_BIT = 1, 2
_ROLLING_SLIDING_AND_SPIN = 6
"""MuJoCo's number of contact dimensions with friction against sliding, spin and rolling."""


@final
class BeansWorld:
    """Beans on the table z = 0 and an upright paddle with a prescribed pose of its middle.

    `ends (2 C, 3)` [m]: initial centres of the round ends of the C beans, two a bean (see `stage.Beans`). The effects
    of `intrusion` act in it. The same calls give the same numbers, bit for bit.
    """

    def __init__(
        self,
        beans: Beans,
        paddle: Paddle,
        ends: Nodes,
        *,
        physics: WorldPhysics | None = None,
        tool: tuple[float, float, float] = HOME_TOOL_M,
        intrusion: Intrusion | None = None,
        time_s: float = 0.0,
    ) -> None:
        self.intrusion = intrusion or Intrusion(())
        physics = self.intrusion.physics(physics or BEAN_WORLD, beans)
        self._reach = beans.length_m / 2 - beans.radius_m
        self._model = _compile(beans, paddle, physics, ends.reshape(-1, 2, 3), self.intrusion)
        self._data = mujoco.MjData(self._model)
        self._beans = np.array([self._model.body(f"bean{index}").id for index in range(len(ends) // 2)])
        self._bend = slice(_POSE.stop, int(self._model.jnt_qposadr[self._model.body_jntadr[self._beans[0]]]))
        self._data.time = time_s
        self.place(pointing_down(np.array(tool)))
        if self.intrusion.acts:
            rests = np.arange(self._model.npair)
            self.intrusion.attach(LooseBeans(self._model, self._data, self._beans, beans, paddle, rests=rests))

    @property
    def time_s(self) -> float:
        """The world's own time [s], from `time_s`."""
        return float(self._data.time)

    @property
    def tool(self) -> ToolPose:
        """Commanded pose of the paddle's middle; it does not open."""
        upright = self._data.qpos[_POSE]
        return np.array([*upright[:3], *_product(upright[3:], np.array(TOOL_DOWN)), 0.0])

    @property
    def paddle(self) -> ToolPose:
        """Actual pose of the paddle's middle: the tool's, unless it is compliant."""
        pose, bent, aside = self.tool, self._data.qpos[self._bend], np.zeros(3)
        if len(bent):
            mujoco.mju_rotVecQuat(aside, np.array([*bent, 0.0]), self._data.qpos[_POSE][3:])
            pose[:3] += aside
        return pose

    def step(self, tool: ToolPose, duration_s: float) -> None:
        """Move the paddle straight to `tool`, turning it evenly, while `duration_s` passes (in whole time steps)."""
        period = self._model.opt.timestep
        start, steps = self._data.qpos[_POSE].copy(), max(1, round(duration_s / period))
        way, turn = tool[:3] - start[:3], _difference(_upright(tool), start[3:])
        for step in range(1, steps + 1):
            share = step / steps
            due = start[3:].copy()
            mujoco.mju_quatIntegrate(due, turn, share)
            self._data.qvel[:3] = (start[:3] + share * way - self._data.qpos[:3]) / period
            self._data.qvel[3:6] = _difference(due, self._data.qpos[3:7]) / period
            self.intrusion.act()
            advance(self._model, self._data)

    def place(self, tool: ToolPose) -> None:
        """Move the paddle to `tool` without contact on the way; no time passes."""
        self._data.qpos[:3], self._data.qpos[3:7] = tool[:3], _upright(tool)
        self._data.qvel[_SPEED] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def nodes(self) -> Nodes:
        """Centres of the beans' round ends [m], shape (2 C, 3)."""
        along = self._reach * self._data.xmat[self._beans].reshape(-1, 3, 3)[:, :, 0]
        middle = self._data.xpos[self._beans]
        return np.stack([middle - along, middle + along], axis=1).reshape(-1, 3)

    def snapshot(self) -> Snapshot:
        """The state to draw, with the arm's joints solved for the present tool pose."""
        tool = self.paddle
        return Snapshot(time_s=self.time_s, nodes=self.nodes(), tool=tool, joints=solve_joints(tool))


def _upright(tool: ToolPose) -> Float64[np.ndarray, "4"]:
    """The paddle's own quaternion: identity for an unturned tool that points down."""
    return _product(tool[3:7], np.array([1.0, -1.0, -1.0, -1.0]) * TOOL_DOWN)


def _product(a: Float64[np.ndarray, "4"], b: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
    """Quaternion of the rotation b, then a."""
    product = np.empty(4)
    mujoco.mju_mulQuat(product, a, b)
    return product


def _difference(after: Float64[np.ndarray, "4"], before: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3"]:
    """Rotation vector [rad], in the body's own frame, from one quaternion to the other."""
    turn = np.empty(3)
    mujoco.mju_subQuat(turn, after, before)
    return turn


def _compile(
    beans: Beans, paddle: Paddle, physics: WorldPhysics, ends: Float64[np.ndarray, "C 2 3"], intrusion: Intrusion
) -> Any:
    """The MuJoCo model: table, paddle, beans."""
    spec = new_spec(physics)
    # Beans at rest sleep: they cannot creep and cost nothing.
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    geom = mujoco.mjtGeom
    table = _contact(physics, physics.table_friction, _TABLE_BIT)
    spec.worldbody.add_geom(name=_TABLE, type=geom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], **table)
    _add_paddle(spec, paddle, _contact(physics, physics.finger_friction, _PADDLE_BIT))
    for index, (first, last) in enumerate(ends):
        along, up = last - first, np.zeros(4)
        mujoco.mju_mat2Quat(up, _frame(along).ravel())
        bean = spec.worldbody.add_body(name=f"bean{index}", pos=(first + last) / 2, quat=up)
        bean.add_freejoint()
        half = beans.length_m / 2 - beans.radius_m
        bean.add_geom(
            name=f"bean{index}",
            type=geom.mjGEOM_CAPSULE,
            size=[beans.radius_m, 0, 0],
            fromto=[-half, 0, 0, half, 0, 0],
            mass=beans.mass_kg / len(ends),
            **_contact(physics, physics.table_friction, _TABLE_BIT | _PADDLE_BIT),
        )
        if intrusion.rubs:
            spec.add_pair(geomname1=_TABLE, geomname2=f"bean{index}", **_rest(physics))
    intrusion.build(spec, physics)
    return spec.compile()


def _rest(physics: WorldPhysics) -> dict[str, Any]:
    """Contact of a bean with the table, as a pair of its own: what it would be without one."""
    sliding, rolling = [physics.table_friction] * 2, [physics.rolling.rolling_m] * 2
    return {
        "condim": _ROLLING_SLIDING_AND_SPIN,
        "friction": [*sliding, physics.rolling.spin_m, *rolling],
        "solref": [physics.contact_time_s, 1.0],
    }


def _frame(along: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """Axes as columns, the first one along `along`, which is not vertical."""
    first = along / np.linalg.norm(along)
    second = np.cross([0.0, 0.0, 1.0], first)
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _add_paddle(spec: Any, paddle: Paddle, contact: dict[str, Any]) -> None:
    """A box on heavy joints, so that contacts see its true velocity (a mocap body's is zero)."""
    body = spec.worldbody.add_body(name=TOOL, gravcomp=1.0)
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=_PRESCRIBED)
    body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, armature=_PRESCRIBED)
    # MuJoCo takes the larger friction of two geoms unless one of them has priority.
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=paddle.half_m, mass=1.0, priority=1, **contact)


def _contact(physics: WorldPhysics, friction: float, bits: int) -> dict[str, Any]:
    return {
        "contype": bits,
        "conaffinity": bits,
        "condim": _ROLLING_SLIDING_AND_SPIN,
        "friction": [friction, physics.rolling.spin_m, physics.rolling.rolling_m],
        "solref": [physics.contact_time_s, 1.0],
    }
