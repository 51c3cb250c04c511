"""Effect injector: applies injected effects to a running MuJoCo world, the one place that knows both."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from jaxtyping import Float64, Int

from app.core.geometry.finger_distance import from_core
from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.tools import Finger
from app.rig.simulated.injected_effects.base import InjectedEffect, Moment, Vectors
from app.rig.simulated.worlds.physics import Position, WorldPhysics
from app.rig.simulated.worlds.rope import hinge_owner

_TABLE_GEOM = 0
_QUIET_M_S, _QUIET_M = 1e-3, 0.02
"""Largest speed of the rope and least distance of the finger at which it is at rest: friction holds it, and it may
sleep."""
_HELD = 0.5
"""Share of the table's friction below which a steady force does not move a rope at rest."""


@final
class Intrusion:
    """Effects in one world; inactive until attached to a model.

    `session`: position of the present push between the first (-0.5) and the last (0.5); set by the caller.
    """

    def __init__(self, hidden: Sequence[InjectedEffect]) -> None:
        self.session = 0.0
        self._hidden = tuple(hidden)
        self._acts = any(_acts(each) for each in hidden)

    @property
    def hides(self) -> bool:
        """True where any effect is in the world itself, not in arm and cameras alone."""
        return any(each.effect.in_world for each in self._hidden)

    def physics(self, physics: WorldPhysics, rope: Rope) -> WorldPhysics:
        """The world's physics with the changes of these effects."""
        for each in self._hidden:
            if each.effect.physics is not None:
                physics = each.effect.physics(physics, rope, each.values)
        return physics

    def build(self, spec: Any, physics: WorldPhysics) -> None:
        """Change the MuJoCo `spec` before it is compiled."""
        for each in self._hidden:
            if each.effect.build is not None:
                each.effect.build(spec, physics, each.values)

    def attach(self, model: Any, data: Any, links: Int[np.ndarray, " S"], rope: Rope, finger: Finger) -> None:
        """Act on this model and its state from now on; `links` are the rope's bodies in order."""
        if self._acts:
            self._chain = _Chain(model, data, links, rope, finger)
            if any(each.effect.friction is not None for each in self._hidden):
                # The larger friction of two geoms counts, so the rope's own may have any value.
                model.geom_friction[_TABLE_GEOM, 0] = 0.0

    def act(self) -> None:
        """Set friction, forces and hinges for the coming time step."""
        if not self._acts:
            return
        for each in self._hidden:
            if each.effect.relaxed is not None:
                self._chain.relax(each.effect.relaxed(self._chain.period_s, each.values))
        if not self._chain.sleeps:
            self._stir()

    def _stir(self) -> None:
        """Set them for a rope that is awake."""
        chain, moment = self._chain, self._chain.moment(self.session)
        friction, stiffness, force = np.ones(len(moment.x)), np.ones(len(moment.x)), np.zeros_like(moment.x)
        for effect, values in ((each.effect, each.values) for each in self._hidden):
            if effect.friction is not None:
                friction = friction * effect.friction(moment, values)
            if effect.stiffness is not None:
                stiffness = stiffness * effect.stiffness(moment, values)
            if effect.force is not None:
                force = force + effect.force(moment, values)
        chain.rub(friction)
        chain.stiffen(stiffness)
        chain.pull(force if chain.stirs(moment, force) else np.zeros_like(force))


@final
class _Chain:
    """The rope and the finger in the arrays of a MuJoCo model and its state."""

    def __init__(self, model: Any, data: Any, links: Int[np.ndarray, " S"], rope: Rope, finger: Finger) -> None:
        self.period_s = float(model.opt.timestep)
        self._model, self._data, self._links = model, data, links
        self._radius_m, self._segment_m = rope.radius_m, rope.length_m / len(links)
        self._finger_radius_m, self._finger = finger.radius_m, model.body("finger").id
        self._finger_half_m = finger.half_m
        # A segment's second geom meets the table; its first hinge turns about the vertical.
        self._soles = model.body_geomadr[links] + 1
        joined = [hinge_owner(index, len(links)) for index in range(1, len(links))]
        self._hinges = model.body_jntadr[links[joined]]
        self._angles, self._lasting = model.jnt_qposadr[self._hinges], model.jnt_plasticadr[self._hinges]
        self._mass = model.body_mass[links].copy()
        self._friction = model.geom_friction[self._soles, 0].copy()
        self._stiffness = model.jnt_stiffness[self._hinges].copy()
        self._gravity = float(np.linalg.norm(model.opt.gravity))
        self._last_tip = data.xpos[self._finger].copy()
        self._tree = model.body_treeid[links[0]]

    @property
    def sleeps(self) -> bool:
        """True while MuJoCo has the rope asleep."""
        return bool(self._data.tree_asleep[self._tree] >= 0)

    def moment(self, session: float) -> Moment:
        """The state as seen by effects."""
        data, period_s = self._data, self.period_s
        x = data.xipos[self._links].copy()
        tip = data.xpos[self._finger].copy()
        velocity, self._last_tip = (tip - self._last_tip) / period_s, tip
        away = self._axis_points(x, tip) - x
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        return Moment(
            time_s=float(data.time),
            session=session,
            period_s=period_s,
            gravity_m_s2=self._gravity,
            radius_m=self._radius_m,
            segment_m=self._segment_m,
            x=x,
            v=self._velocities(x),
            mass=self._mass,
            finger=tip,
            finger_v=velocity,
            toward=away / length[:, None],
            gap_m=length - self._radius_m - self._finger_radius_m,
        )

    def stirs(self, moment: Moment, force: Vectors) -> bool:
        """True where `force` matters: something moves, the finger is near, or friction would not hold the rope."""
        if moment.gap_m.min() < _QUIET_M or np.abs(moment.v).max() > _QUIET_M_S:
            return True
        holds = _HELD * self._model.geom_friction[self._soles, 0] * self._mass * self._gravity
        return bool(np.any(np.linalg.norm(force, axis=1) > holds))

    def rub(self, factor: Float64[np.ndarray, " S"]) -> None:
        """Set the friction of each segment on the table, as a multiple of its own."""
        self._model.geom_friction[self._soles, 0] = self._friction * factor

    def stiffen(self, factor: Float64[np.ndarray, " S"]) -> None:
        """Set the stiffness of the hinge before each segment but the first, as a multiple of its own."""
        self._model.jnt_stiffness[self._hinges] = self._stiffness * factor[1:]

    def pull(self, force: Vectors) -> None:
        """Apply a force [N] at the middle of each segment."""
        self._data.xfrc_applied[self._links, :3] = force

    def relax(self, share: float) -> None:
        """Make this share of each hinge's elastic bend permanent."""
        lasting = self._data.plastic[self._lasting]
        elastic = self._data.qpos[self._angles] - self._model.qpos_spring[self._angles] - lasting
        self._data.plastic[self._lasting] = lasting + share * elastic

    def _axis_points(self, x: Vectors, tip: Position) -> Vectors:
        """Nearest point to each segment on the finger's core, which ends a radius above its tip."""
        points = np.repeat(tip[None], len(x), axis=0)
        points[:, :2] = x[:, :2] + from_core(points[:, :2] - x[:, :2], self._finger_half_m)
        points[:, 2] = np.maximum(x[:, 2], tip[2] + self._finger_radius_m)
        return points

    def _velocities(self, x: Vectors) -> Vectors:
        """Velocities of the segments' centres [m/s]; MuJoCo keeps those at the whole rope's centre of mass."""
        spin, carried = self._data.cvel[self._links, :3], self._data.cvel[self._links, 3:]
        return carried + np.cross(spin, x - self._data.subtree_com[self._model.body_rootid[self._links]])


def _acts(each: InjectedEffect) -> bool:
    """True for an effect that acts in each time step."""
    effect = each.effect
    return any(hook is not None for hook in (effect.friction, effect.force, effect.stiffness, effect.relaxed))
