"""Loose beans, and the paddle that sweeps them."""

from typing import Any, final

import numpy as np
from jaxtyping import Float64, Int

from app.core.geometry.scene_description import Beans
from app.core.geometry.shapes.tools import Paddle
from app.rig.simulated.injected_effects.base import Factors, Moment, Vectors
from app.rig.simulated.worlds.engine import TOOL

_QUIET_M_S, _QUIET_M = 1e-3, 0.02
"""Largest speed of a bean and least distance of the paddle at which it is at rest, and may sleep."""
_HELD = 0.5
"""Share of the resistance to rolling below which a steady force does not move a bean at rest."""
_SLIDING, _ROLLING = 0, 4
"""Columns of a contact pair's friction; the others are the second direction of sliding, spin, and the second axis of
rolling."""


@final
class LooseBeans:
    """The beans' bodies, `beans` in order, each with a free joint and one geom.

    `rests`: the model's contact pairs of each bean with the table, none where friction is left as it is. Friction on
    the table is that against sliding, spinning and rolling alike, so that the way to rest changes by one over its
    factor; beans rub on each other as ever. Their stiffness is that of their contacts: MuJoCo's time constant goes with
    one over its root, and is at least two time steps.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        bodies: Int[np.ndarray, " S"],
        beans: Beans,
        paddle: Paddle,
        *,
        rests: Int[np.ndarray, " R"],
    ) -> None:
        self.period_s = float(model.opt.timestep)
        self._model, self._data, self._bodies, self._rests = model, data, bodies, rests
        self._radius_m, self._length_m = beans.radius_m, beans.length_m
        self._paddle, self._half_m = model.body(TOOL).id, np.array(paddle.half_m)
        self._geoms = model.body_geomadr[bodies]
        self._speeds = model.jnt_dofadr[model.body_jntadr[bodies]][:, None] + np.arange(3)
        self._trees = model.body_treeid[bodies]
        self._mass = model.body_mass[bodies].copy()
        self._friction = model.pair_friction[rests].copy()
        self._contact_s = model.geom_solref[self._geoms, 0].copy(), model.pair_solref[rests, 0].copy()
        sliding, _, rolling_m = model.geom_friction[self._geoms[0]]
        self._gravity = float(np.linalg.norm(model.opt.gravity))
        self._holds_n = _HELD * min(sliding, rolling_m / beans.radius_m) * self._mass * self._gravity
        self._factor = np.ones(len(bodies))

    @property
    def sleeps(self) -> bool:
        """True while MuJoCo has all beans asleep."""
        return bool(np.all(self._data.tree_asleep[self._trees] >= 0))

    def moment(self, session: float) -> Moment:
        """The state as seen by effects."""
        data = self._data
        x = data.xipos[self._bodies].copy()
        away, distance_m = self._to_paddle(x)
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
            tool=data.xpos[self._paddle].copy(),
            tool_v=data.qvel[:3].copy(),
            toward=away / np.maximum(distance_m, 1e-9)[:, None],
            gap_m=distance_m - self._radius_m,
        )

    def rub(self, factor: Factors) -> None:
        """Set the friction of each bean on the table, as a multiple of its own."""
        if len(self._rests):
            self._model.pair_friction[self._rests] = self._friction * factor[:, None]
            self._factor = factor

    def stiffen(self, factor: Factors) -> None:
        """Set the stiffness of each bean's contacts, as a multiple of its own."""
        on_beans, on_table = self._contact_s
        self._model.geom_solref[self._geoms, 0] = on_beans / np.sqrt(factor)
        if len(self._rests):
            self._model.pair_solref[self._rests, 0] = on_table / np.sqrt(factor)

    def pull(self, moment: Moment, force: Vectors) -> None:
        """Apply a force [N] at the middle of each bean, but to those that are held at rest."""
        moves = (moment.gap_m < _QUIET_M) | (np.abs(moment.v).max(1) > _QUIET_M_S)
        stirs = moves | (np.linalg.norm(force, axis=1) > self._holds_n * self._factor)
        self._data.xfrc_applied[self._bodies, :3] = np.where(stirs[:, None], force, 0.0)

    def relax(self, share: float) -> None:
        """Nothing: beans have no lasting shape but their own."""

    def _to_paddle(self, x: Vectors) -> tuple[Vectors, Float64[np.ndarray, " S"]]:
        """Vectors to the paddle's nearest point, from the nearest of each bean's middle and its round ends."""
        along = self._data.xmat[self._bodies].reshape(-1, 3, 3)[:, :, 0]
        shares = (self._length_m / 2 - self._radius_m) * np.array([-1.0, 0.0, 1.0])
        points = x[:, None] + shares[:, None] * along[:, None]
        turn = self._data.xmat[self._paddle].reshape(3, 3)
        inside = (points - self._data.xpos[self._paddle]) @ turn
        away = np.clip(inside, -self._half_m, self._half_m) - inside
        distance_m = np.linalg.norm(away, axis=-1)
        nearest = distance_m.argmin(1)
        each = np.arange(len(x))
        return away[each, nearest] @ turn.T, distance_m[each, nearest]
