"""Knots of a cloth, and the gripper that carries it."""

from typing import Any, final

import numpy as np

from app.core.geometry.scene_description import Cloth
from app.core.geometry.shapes.tools import Gripper
from app.rig.simulated.injected_effects.base import Factors, Moment, Vectors
from app.rig.simulated.worlds.engine import TOOL

_TABLE_GEOM = 0


@final
class ClothKnots:
    """The knots of the cloth's mesh, row by row, each with three slides, and the mass of its part of the cloth.

    A flex has one friction on the table, and one stiffness: those of all knots are the mean of theirs.
    """

    def __init__(self, model: Any, data: Any, cloth: Cloth, gripper: Gripper) -> None:
        self.period_s = float(model.opt.timestep)
        self._model, self._data, self._hand = model, data, model.body(TOOL).id
        count = cloth.nodes_a_side**2
        self._bodies = np.asarray(model.flex_vertbodyid[:count]).copy()
        self._speeds = model.body_dofadr[self._bodies][:, None] + np.arange(3)
        self._mass = model.body_mass[self._bodies].copy()
        self._radius_m, self._length_m = float(model.flex_radius[0]), cloth.size_m / (cloth.nodes_a_side - 1)
        self._finger_m = gripper.half_m[1]
        self._gravity = float(np.linalg.norm(model.opt.gravity))
        self._friction, self._stiffness = float(model.geom_friction[_TABLE_GEOM, 0]), model.flex_stiffness.copy()

    @property
    def sleeps(self) -> bool:
        """False: a world of cloth is not stepped while it sleeps."""
        return False

    def moment(self, session: float) -> Moment:
        """The state as seen by effects; the tool is the point between the fingers' tips."""
        data = self._data
        x, tool = data.flexvert_xpos.copy(), data.xpos[self._hand].copy()
        away = tool - x
        distance_m = np.linalg.norm(away, axis=1)
        return Moment(
            time_s=float(data.time),
            session=session,
            period_s=self.period_s,
            gravity_m_s2=self._gravity,
            radius_m=self._radius_m,
            length_m=self._length_m,
            x=x,
            v=data.qvel[self._speeds],
            mass=self._mass,
            tool=tool,
            tool_v=data.qvel[:3].copy(),
            toward=away / np.maximum(distance_m, 1e-9)[:, None],
            gap_m=distance_m - self._radius_m - self._finger_m,
        )

    def rub(self, factor: Factors) -> None:
        """Set the friction of the whole cloth on the table, as a multiple of its own."""
        self._model.geom_friction[_TABLE_GEOM, 0] = self._friction * factor.mean()

    def stiffen(self, factor: Factors) -> None:
        """Set the stiffness of the whole cloth, as a multiple of its own."""
        self._model.flex_stiffness[:] = self._stiffness * factor.mean()

    def pull(self, moment: Moment, force: Vectors) -> None:
        """Apply a force [N] at each knot."""
        del moment
        self._data.xfrc_applied[self._bodies, :3] = force

    def relax(self, share: float) -> None:
        """Nothing: a cloth bends freely, and keeps no shape."""
