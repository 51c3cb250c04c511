"""Pushing a rope on a table into a goal shape with one finger (paper, rope task)."""

from dataclasses import replace
from math import ceil, pi, sqrt
from types import MappingProxyType

from app.core.colours import ColourRange
from app.core.geometry.scene_description import Rope, Stage
from app.core.geometry.shapes.tools import Finger
from app.perception.reconstruct import Reconstruction
from app.planner.actions.actions import Pushes
from app.planner.search.cost import Weights
from app.planner.search.optimise import OptimizerConfig
from app.policy.scripted import ScriptedPush
from app.policy.symmetry import Symmetry
from app.sim.materials.rope import RopeMaterial
from app.sim.model.scene import Body, Scene
from app.sim.tools.finger import FingerCollider
from app.sim.tools.flat_finger import FlatFinger
from app.tasks.elements.base import Preset, Task
from app.tasks.elements.curves import CurveSampler, RopeProblems
from app.tasks.elements.rods import rods_of
from app.tasks.elements.success import Near

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.064, colour=(0.80, 0.24, 0.10))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)

LOWEST_M = 0.0055
"""Least height of a finger's tip: the workspace ends half a millimetre below."""

DT_S, PUSH_SUBSTEPS, DENSITY_KG_M3 = 7.0e-4, 240, 795.0
"""Time steps of material points in a push, for this rope or a denser one."""

BESIDE_M = 0.008
"""Clearance from the rope at the start of a push: perception errs by up to 3 mm, the arm by about 1 mm."""

TIGHT = CurveSampler(
    max_shift_m=0.12, max_bend_rad=1.1, max_turn_rad=3.0, min_gap_m=0.030, gap_m=(0.03, 0.07), margin_m=0.06
)
"""Hard starts and goals: bent more, nearer to themselves than a finger is wide with its clearance, and to borders."""


def _task(rope: Rope, finger: Finger) -> Task:
    """The task with this rope and this finger, which pushes a thinner rope nearer to the table."""
    finger = replace(finger, push_height_m=min(finger.push_height_m, max(LOWEST_M, 0.75 * rope.radius_m)))
    touch_m = rope.radius_m + finger.radius_m
    volume_m3 = pi * rope.radius_m**2 * rope.length_m
    # Waves are faster in what is lighter, and time steps as much shorter.
    substeps = ceil(PUSH_SUBSTEPS * max(1.0, sqrt(DENSITY_KG_M3 * volume_m3 / rope.mass_kg)))
    clearance_m = touch_m + BESIDE_M
    return Task(
        name="rope_push",
        stage=Stage(body=rope, tool=finger),
        perception=Reconstruction(
            colour=ColourRange.around(rope.colour), particle_count=300, half_width_m=rope.radius_m + 0.002
        ),
        # A real push takes 1 s, a simulated one 0.2 s. Weight and stiffness are twelve times the real ones, which
        # leaves their ratio, and with it every quasi-static shape, as it is, and keeps inertia small beside them.
        scene=Scene(
            low=(0.15, -0.45, -0.025),
            high=(0.95, 0.45, 0.075),
            cell_m=0.0125,
            dt_s=DT_S * PUSH_SUBSTEPS / substeps,
            gravity_m_s2=117.7,
            bodies=(
                Body(
                    volume_m3=volume_m3,
                    density_kg_m3=rope.mass_kg / volume_m3,
                    material=RopeMaterial(fibre_pa=2.5e5, core_m=rope.radius_m / 2, yield_strain=0.1),
                ),
            ),
            tools=(_particle_tool(finger),),
            contact_margin_m=0.0035,
            contact_width_m=0.001,
            contact_substeps=3.0,
            damping_1_s=4.0,
        ),
        actions=Pushes(
            region=(0.27, -0.33, 0.83, 0.33),
            height_m=finger.push_height_m,
            clearance_m=clearance_m,
            core_m=finger.half_m,
            max_displacement_m=0.010,
            max_length_m=0.18,
            random_length_m=(0.06, 0.16),
            speed_m_s=0.15,
            approach_m_s=0.20,
            push_substeps=substeps,
            rest_substeps=substeps // 12,
        ),
        policy=ScriptedPush(
            start_gap_m=clearance_m + 0.004,
            contact_gap_m=touch_m,
            max_length_m=0.18,
            clearance_m=clearance_m,
            core_m=finger.half_m,
        ),
        symmetry=_symmetry(finger),
        weights=Weights(progress=1.0, contact=0.002, discount=0.7),
        descent=OptimizerConfig(learning_rate=1.0, clip=1.0, shrink=0.5),
        problems=RopeProblems(rope=rope),
        nominal=MappingProxyType({"stiffness": 6.0e4, "table_friction": 0.5, "finger_friction": 0.3}),
        calibrated=("stiffness", "table_friction"),
        success=Near(limit_m2=2 * 0.012**2),
        stop_when=Near(limit_m2=2 * 0.010**2),
        horizon=30,
        time_scale=5.0,
        own_dynamics="rods",
        sized=_task,
        hard=_hard,
        rods=rods_of(
            rope,
            finger,
            {
                "cpu": Preset(branches=32, depth=2, particle_count=300, gradient_steps=16),
                "gpu": Preset(branches=64, depth=3, particle_count=2000, gradient_steps=10),
            },
        ),
        presets=MappingProxyType(
            {
                "cpu": Preset(branches=8, depth=2, particle_count=300, gradient_steps=5),
                "gpu": Preset(branches=16, depth=3, particle_count=2000, gradient_steps=10),
            }
        ),
    )


def _hard(task: Task) -> Task:
    """The task with hard problems."""
    return replace(task, problems=RopeProblems(rope=task.rope, curves=TIGHT))


def _symmetry(finger: Finger) -> Symmetry:
    """A flat finger does not turn with the table, but is the same after half a turn."""
    about_m, shift_m = (0.55, 0.0), (0.08, 0.08)
    if finger.half_width_m == 0:
        return Symmetry(about_m=about_m, turns=True, mirrored=True, shift_m=shift_m)
    return Symmetry(about_m=about_m, angles_rad=(0.0, pi), shift_m=shift_m)


def _particle_tool(finger: Finger) -> FingerCollider | FlatFinger:
    """The finger among material points."""
    if finger.half_width_m == 0:
        return FingerCollider(radius_m=finger.radius_m, below_m=0.0035, fade_m=0.001)
    return FlatFinger(
        radius_m=finger.radius_m,
        half_width_m=finger.half_width_m,
        yaw_rad=finger.yaw_rad,
        below_m=0.0035,
        fade_m=0.001,
    )


TASK = _task(ROPE, FINGER)
