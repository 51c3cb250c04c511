"""Rods of the simulated cell's tasks: numbers of their contact, and times of their pushes, which all ropes share."""

from collections.abc import Mapping
from types import MappingProxyType

from app.core.geometry.scene_description import Rope
from app.core.geometry.shapes.tools import Finger
from app.sim.rods.scene import RodScene, Wall
from app.tasks.elements.base import Preset, RodDynamics

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
