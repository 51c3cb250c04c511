"""The simulated table: a cloth that a gripper picks up and hangs over a rack, in MuJoCo. No clock: it is stepped.

The cloth is a flex: a mesh of linear triangles that resist stretch and shear, and bend freely. It touches table, rods
and fingers, but not itself, which would take twice the time and matters little to a hanging cloth.
"""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from jaxtyping import Bool, Float64

from app.core.geometry.scene_description import Cloth
from app.core.geometry.shapes.fixtures import Fixture, Rack
from app.core.geometry.shapes.tools import Gripper
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.bodies.cloth_knots import ClothKnots
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.engine import TOOL, advance, mujoco, new_spec
from app.rig.simulated.worlds.physics import CLOTH_WORLD, HOME_TOOL_M, WorldPhysics
from app.rig.simulated.worlds.sleep_detection import Rest
from app.rig.simulated.worlds.world import Nodes, Snapshot

_PRESCRIBED_KG = 1000.0
"""Inertia of the gripper's slides: so large that no contact changes their prescribed velocity."""
_STANDING_BIT, _FINGER_BIT = 1, 2
_PLACE = slice(0, 3)
"""Coordinates of the gripper, the first of the model: x, y, z of the point between its tips, then its turn about the
vertical, if it turns, and half of the opening, once a finger."""
_YAW = 3
_CLOTH = "cloth"
_STRETCH = 2
"""MuJoCo's `elastic2d` of a sheet with membrane forces alone."""


@final
class ClothWorld:
    """A cloth and a gripper that points down, with a prescribed position, turn and opening of its tips.

    `nodes (K, 3)` [m]: initial positions of the mesh's nodes, row by row, K = `cloth.nodes_a_side` squared; unstrained
    they are a flat square. A gripper that `turns` does so about the vertical; the turn of another stays what it is. The
    effects of `intrusion` act in it. Fingers that close to `gripper.closed_m` hold the nodes between them until they
    open again: a pinched fold is a few millimetres wide, which a mesh of this size cannot form, so that friction would
    have nothing to act on. The same calls give the same numbers, bit for bit.
    """

    def __init__(
        self,
        cloth: Cloth,
        gripper: Gripper,
        nodes: Nodes,
        *,
        fixtures: Sequence[Fixture] = (),
        physics: WorldPhysics | None = None,
        tool: ToolPose | None = None,
        turns: bool = False,
        intrusion: Intrusion | None = None,
        time_s: float = 0.0,
    ) -> None:
        self._turns, self._own = turns, slice(0, 6 if turns else 5)
        self.intrusion = intrusion or Intrusion(())
        self._gripper = gripper
        self._reach = _reach(cloth, gripper)
        physics = self.intrusion.physics(physics or CLOTH_WORLD, cloth)
        self._model = _compile(cloth, gripper, physics, fixtures, self.intrusion, turns=turns)
        self._data = mujoco.MjData(self._model)
        first = int(self._model.body(f"{_CLOTH}_0").id)
        flat = self._model.body_pos[first : first + len(nodes)]
        self._data.qpos[self._own.stop :] = (nodes - flat).ravel()
        self._data.time = time_s
        self.place(pointing_down(np.array(HOME_TOOL_M)) if tool is None else tool)
        if self.intrusion.acts:
            self.intrusion.attach(ClothKnots(self._model, self._data, cloth, gripper))

    @property
    def time_s(self) -> float:
        """The world's own time [s], from `time_s`."""
        return float(self._data.time)

    @property
    def tool(self) -> ToolPose:
        """Pose of the point between the fingertips, which points down, and their opening."""
        half_turn = self._yaw / 2
        turn = [0.0, np.cos(half_turn), np.sin(half_turn), 0.0]
        return np.array([*self._data.qpos[_PLACE], *turn, 2 * self._data.qpos[self._own.stop - 1]])

    @property
    def held_nodes(self) -> Bool[np.ndarray, " K"]:
        """Mask of the nodes that the fingers hold."""
        return self._data.eq_active.astype(bool)

    def step(self, tool: ToolPose, duration_s: float) -> None:
        """Move the tool in a straight line there while `duration_s` passes (rounded to whole time steps)."""
        period = self._model.opt.timestep
        start, end = self._data.qpos[self._own].copy(), self._coordinates(tool)
        if self._turns:
            end[_YAW] = start[_YAW] + _nearest_turn(end[_YAW] - start[_YAW])
        steps = max(1, round(duration_s / period))
        if self._rest.lasts(start, end):
            self._data.time += steps * period
            return
        before = self.nodes()
        for step in range(1, steps + 1):
            due = start + (end - start) * (step / steps)
            self._data.qvel[self._own] = (due - self._data.qpos[self._own]) / period
            self._grasp(opening_m=2 * due[-1])
            self.intrusion.act()
            advance(self._model, self._data)
        self._rest.watch(before, self.nodes(), steps * period)

    def place(self, tool: ToolPose) -> None:
        """Move the tool to `tool` without contact on the way, with empty fingers; no time passes."""
        self._data.qpos[self._own] = self._coordinates(tool)
        self._data.qvel[self._own] = 0.0
        self._data.eq_active[:] = 0
        self._rest = Rest()
        self._open = bool(tool[7] > self._gripper.closed_m)
        mujoco.mj_forward(self._model, self._data)

    def rest(self, until_s: float) -> None:
        """Let time pass without any motion: a cloth that hangs never ceases to stir a little."""
        self._data.time = max(self.time_s, until_s)

    def nodes(self) -> Nodes:
        """The nodes of the mesh [m], row by row."""
        return self._data.flexvert_xpos.copy()

    def snapshot(self) -> Snapshot:
        """The state to draw, with the arm's joints solved for the present tool pose."""
        tool = self.tool
        return Snapshot(time_s=self.time_s, nodes=self.nodes(), tool=tool, joints=solve_joints(tool))

    @property
    def _yaw(self) -> float:
        return float(self._data.qpos[_YAW]) if self._turns else 0.0

    def _coordinates(self, tool: ToolPose) -> Float64[np.ndarray, " S"]:
        """The gripper's coordinates at a pose: half a turn about x, as it points down, and one about the vertical."""
        turn = [2 * np.arctan2(tool[5], tool[4])] if self._turns else []
        return np.array([*tool[:3], *turn, tool[7] / 2, tool[7] / 2])

    def _grasp(self, opening_m: float) -> None:
        """Grasp as the fingers close on something, and release as they open."""
        opened = opening_m > self._gripper.closed_m
        if opened:
            self._data.eq_active[:] = 0
        elif self._open:
            self._hold(opening_m)
        self._open = opened

    def _hold(self, opening_m: float) -> None:
        """Constrain the nodes whose part of the cloth is between the fingers to their present place in the hand."""
        away = self.nodes() - self._data.qpos[_PLACE]
        if self._turns:
            away = away @ _axes(self._yaw)
        across, aside, up = self._reach
        low = self._model.flex_radius[0]
        near = np.abs(away[:, 0]) < across
        near &= np.abs(away[:, 1]) < aside + opening_m / 2
        near &= (away[:, 2] > -3 * low) & (away[:, 2] < up)
        pressed = away * [1.0, opening_m / (opening_m + 2 * aside), 1.0]
        # From a point of the hand to the node: as compiled, a constraint is as long as they were apart.
        self._model.eq_data[near, :3] = pressed[near]
        self._model.eq_data[near, 3:6] = 0.0
        self._data.eq_active[:] = near


def _nearest_turn(angle: float) -> float:
    """The angle [rad] without whole turns."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _axes(yaw: float) -> Float64[np.ndarray, "3 3"]:
    """Axes of the hand as columns."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _reach(cloth: Cloth, gripper: Gripper) -> Float64[np.ndarray, "3"]:
    """Half extents about the tool of held nodes: half a mesh width beyond a finger's side, and a finger's length."""
    half_mesh = cloth.size_m / (cloth.nodes_a_side - 1) / 2
    return np.array([gripper.half_m[0] + half_mesh, half_mesh, 2 * gripper.half_m[2]])


def _compile(
    cloth: Cloth,
    gripper: Gripper,
    physics: WorldPhysics,
    fixtures: Sequence[Fixture],
    intrusion: Intrusion,
    *,
    turns: bool,
) -> Any:
    """The MuJoCo model: table, rods, gripper (its slides are the first coordinates), cloth."""
    spec = new_spec(physics)
    standing = {"contype": _STANDING_BIT, "conaffinity": _STANDING_BIT, "solref": [physics.contact_time_s, 1.0]}
    # The geom's friction coefficient counts: it has priority over the cloth.
    table = {"friction": [physics.table_friction, 0.0, 0.0], "priority": 1}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], **table, **standing)
    for fixture in fixtures:
        _add_fixture(spec, fixture, standing)
    _add_gripper(spec, gripper, physics, turns=turns)
    _add_cloth(spec, cloth, physics)
    intrusion.build(spec, physics)
    model = spec.compile()
    model.dof_damping[6 if turns else 5 :] = physics.cloth.air_drag_1_s * cloth.mass_kg / cloth.nodes_a_side**2
    return model


def _add_fixture(spec: Any, fixture: Fixture, standing: dict[str, Any]) -> None:
    """Add a rack's rods. Raises TypeError for fixtures that this world has no shape for."""
    if not isinstance(fixture, Rack):
        raise TypeError(f"The world of a cloth knows racks, not a {type(fixture).__name__}.")
    for begin, end in fixture.ends_m():
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[fixture.radius_m, 0, 0],
            fromto=[*begin, *end],
            friction=[fixture.friction, 0.0, 0.0],
            priority=1,
            **standing,
        )


def _add_gripper(spec: Any, gripper: Gripper, physics: WorldPhysics, *, turns: bool) -> None:
    """Add two boxes on heavy slides, so that contacts see their true velocity (a mocap body's is zero)."""
    hand = spec.worldbody.add_body(name=TOOL, gravcomp=1.0)
    hand.explicitinertial, hand.mass, hand.inertia = True, 1.0, [1e-3] * 3
    for axis in np.eye(3):
        hand.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=_PRESCRIBED_KG)
    if turns:
        hand.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], armature=_PRESCRIBED_KG)
    _, thick, tall = gripper.half_m
    for side in (1, -1):
        finger = hand.add_body(gravcomp=1.0)
        finger.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, side, 0], armature=_PRESCRIBED_KG)
        finger.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=gripper.half_m,
            pos=[0.0, side * thick, tall],
            mass=0.1,
            contype=_FINGER_BIT,
            conaffinity=_FINGER_BIT,
            friction=[physics.finger_friction, 0.0, 0.0],
            solref=[physics.contact_time_s, 1.0],
            priority=2,
        )


def _add_cloth(spec: Any, cloth: Cloth, physics: WorldPhysics) -> None:
    """Add the flex, flat about the origin, and for each node an inactive constraint to the hand."""
    count, own = cloth.nodes_a_side, physics.cloth
    sheet = spec.worldbody.make_flex(
        name=_CLOTH,
        type="grid",
        dim=2,
        count=[count, count, 1],
        spacing=[cloth.size_m / (count - 1)] * 3,
        radius=own.cloth_half_thickness_m,
        mass=cloth.mass_kg,
    )
    sheet.elastic2d = _STRETCH
    sheet.thickness = 2 * own.cloth_half_thickness_m
    sheet.young = own.membrane_n_m / sheet.thickness
    sheet.poisson, sheet.damping = own.poisson, own.membrane_damping_s
    sheet.contype = sheet.conaffinity = _STANDING_BIT | _FINGER_BIT
    sheet.condim, sheet.selfcollide = 3, mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    sheet.solref = [physics.contact_time_s, 1.0]
    for knot in range(count**2):
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=TOOL,
            name2=f"{_CLOTH}_{knot}",
            active=False,
            data=np.zeros(12),
            solref=[own.hold_time_s, 1.0],
        )
