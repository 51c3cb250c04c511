"""Rods of the simulated cell's tasks: numbers of their contact, and times of their pushes, which all ropes share."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import final

from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.tools import Finger
from app.sim.model.params import PARAMETERS, index
from app.sim.rods.scene import RodScene, Wall
from app.tasks.elements.base import Preset

PUSH_S, REST_S = 1.2, 0.15
"""Durations of a push, 18 cm at 0.15 m/s, and of the rest after it."""
DT_S, THIN_DT_S, THIN_M = 2e-3, 1e-3, 0.006
"""Time steps. With shorter ones slopes are rougher and pushes no truer (docs/rods.md); thinner ropes bend so little
that longer ones would let them stretch by more than a hundredth."""
CONTACT = MappingProxyType({"climb": 0.32, "press": 0.36, "margin": 8e-4})
"""Contact parameters of the simulated cell, whose rope hops a little as it slides (`bench.rods`)."""
MAX_RIGIDITY_N_M2 = 5e-3
"""Eight times that of the real rope measured (docs/real-data.md)."""
NOMINAL = MappingProxyType({"stiffness": 1.865e4, "table_friction": 0.50, "finger_friction": 0.24})


@final
@dataclass(frozen=True, kw_only=True)
class RodDynamics:
    """Rod simulation of a task's rope, in real time and under real weight.

    `physics`: parameters of its contact with finger and table, by the names of `RodPhysics`; `nominal`, `presets`: as
    a task's; `push_substeps`, `rest_substeps`: time steps of the scene in a push and in the rest after it.
    """

    scene: RodScene
    physics: Mapping[str, float]
    nominal: Mapping[str, float]
    presets: Mapping[str, Preset]
    push_substeps: int
    rest_substeps: int
    max_rigidity_n_m2: float
    """The largest bending rigidity that is simulated, by `stiff_scene`."""
    calibrated: tuple[str, ...] = ("stiffness", "table_friction", "finger_friction")
    """Parameters that calibration estimates."""
    tool_offset: tuple[str, ...] = ("tcp_x", "tcp_y")
    """Components of the tool's offset in its own frame that calibration estimates besides, if recordings tell them."""

    @property
    def stiff_scene(self) -> RodScene:
        """The scene of ropes that are stiffer than `scene` bears: limp ones are simulated less truly in it."""
        most = PARAMETERS[index("stiffness")].high * self.scene.second_moment_m4
        return replace(self.scene, stiffest_n_m2=max(self.scene.max_rigidity_n_m2, min(self.max_rigidity_n_m2, most)))

    def scene_for(self, *, stiff: bool) -> RodScene:
        """`stiff_scene` or `scene`."""
        return self.stiff_scene if stiff else self.scene


def rods_of(
    rope: Rope,
    finger: Finger,
    presets: Mapping[str, Preset],
    *,
    walls: tuple[Wall, ...] = (),
    stiffest_n_m2: float | None = None,
) -> RodDynamics:
    """Rod simulation of a rope, pushed by a finger, among walls; the rest as in `RodScene`.

    With `stiffest_n_m2` all ropes up to that are simulated by one scene, so that a model may become a limp rope's in
    the middle of an episode and the planner is not compiled anew.
    """
    dt_s = DT_S if rope.radius_m > THIN_M else THIN_DT_S
    return RodDynamics(
        scene=RodScene(
            length_m=rope.length_m,
            radius_m=rope.radius_m,
            mass_kg=rope.mass_kg,
            finger_radius_m=finger.radius_m,
            finger_half_width_m=finger.half_width_m,
            finger_yaw_rad=finger.yaw_rad,
            dt_s=dt_s,
            walls=walls,
            stiffest_n_m2=stiffest_n_m2,
        ),
        physics=CONTACT,
        max_rigidity_n_m2=stiffest_n_m2 or MAX_RIGIDITY_N_M2,
        nominal=NOMINAL,
        presets=MappingProxyType(dict(presets)),
        push_substeps=round(PUSH_S / dt_s),
        rest_substeps=round(REST_S / dt_s),
    )
