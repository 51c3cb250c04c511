"""Segments of a rope that is a chain, and the finger that pushes it."""

from typing import Any, final

import numpy as np
from jaxtyping import Int

from app.core.geometry.finger_distance import from_core
from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.tools import Finger
from app.rig.simulated.injected_effects.base import Factors, Moment, Vectors
from app.rig.simulated.worlds.engine import TOOL
from app.rig.simulated.worlds.physics import Position
from app.rig.simulated.worlds.rope import hinge_owner

_TABLE_GEOM = 0
_QUIET_M_S, _QUIET_M = 1e-3, 0.02
"""Largest speed of the rope and least distance of the finger at which it is at rest: friction holds it, and it may
sleep."""
_HELD = 0.5
"""Share of the table's friction below which a steady force does not move a rope at rest."""


@final
class RopeSegments:
    """The rope's segments, `links` in order; their stiffness is that of their hinges.

    `rubbed`: their friction on the table is set, for which the table's own is taken away.
    """

    def __init__(
        self, model: Any, data: Any, links: Int[np.ndarray, " S"], rope: Rope, finger: Finger, *, rubbed: bool
    ) -> None:
        self.period_s = float(model.opt.timestep)
        self._model, self._data, self._links = model, data, links
        self._radius_m, self._length_m = rope.radius_m, rope.length_m / len(links)
        self._finger_radius_m, self._finger = finger.radius_m, model.body(TOOL).id
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
        if rubbed:
            # The larger friction of two geoms counts, so the rope's own may have any value.
            model.geom_friction[_TABLE_GEOM, 0] = 0.0

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
            length_m=self._length_m,
            x=x,
            v=self._velocities(x),
            mass=self._mass,
            tool=tip,
            tool_v=velocity,
            toward=away / length[:, None],
            gap_m=length - self._radius_m - self._finger_radius_m,
        )

    def rub(self, factor: Factors) -> None:
        """Set the friction of each segment on the table, as a multiple of its own."""
        self._model.geom_friction[self._soles, 0] = self._friction * factor

    def stiffen(self, factor: Factors) -> None:
        """Set the stiffness of the hinge before each segment but the first, as a multiple of its own."""
        self._model.jnt_stiffness[self._hinges] = self._stiffness * factor[1:]

    def pull(self, moment: Moment, force: Vectors) -> None:
        """Apply a force [N] at the middle of each segment, or none where the whole rope is held at rest."""
        self._data.xfrc_applied[self._links, :3] = force if self._stirs(moment, force) else np.zeros_like(force)

    def relax(self, share: float) -> None:
        """Make this share of each hinge's elastic bend permanent."""
        lasting = self._data.plastic[self._lasting]
        elastic = self._data.qpos[self._angles] - self._model.qpos_spring[self._angles] - lasting
        self._data.plastic[self._lasting] = lasting + share * elastic

    def _stirs(self, moment: Moment, force: Vectors) -> bool:
        """True where `force` matters: something moves, the finger is near, or friction would not hold the rope."""
        if moment.gap_m.min() < _QUIET_M or np.abs(moment.v).max() > _QUIET_M_S:
            return True
        holds = _HELD * self._model.geom_friction[self._soles, 0] * self._mass * self._gravity
        return bool(np.any(np.linalg.norm(force, axis=1) > holds))

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
