"""Pushing a rope on a table into a goal shape with one finger (paper, rope task)."""

from math import pi
from types import MappingProxyType

from app.core.colours import ColourRange
from app.core.stage import Finger, Rope, Stage
from app.perception.reconstruct import Reconstruction
from app.planner.actions import Pushes
from app.planner.cost import Weights
from app.planner.optimise import Descent
from app.policy.scripted import ScriptedPush
from app.policy.symmetry import Symmetry
from app.sim.materials.rope import Rope as RopeMaterial
from app.sim.rods.scene import RodScene
from app.sim.scene import Body, Scene
from app.sim.tools import finger as sim_finger
from app.tasks.aim import Near
from app.tasks.base import Preset, RodDynamics, Task
from app.tasks.curves import RopeProblems

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.064, colour=(0.80, 0.24, 0.10))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)

# Beside the rope by 8 mm: perception errs by up to 3 mm, the arm by about 1 mm.
CLEARANCE_M = ROPE.radius_m + FINGER.radius_m + 0.008
TOUCH_M = ROPE.radius_m + FINGER.radius_m

TASK = Task(
    name="rope_push",
    stage=Stage(body=ROPE, tool=FINGER),
    seeing=Reconstruction(colour=ColourRange.around(ROPE.colour), particle_count=300, half_width_m=0.010),
    # A real push takes 1 s, a simulated one 0.2 s. Weight and stiffness are twelve times the real ones, which leaves
    # their ratio, and with it every quasi-static shape, as it is, and keeps inertia small beside them.
    scene=Scene(
        low=(0.15, -0.45, -0.025),
        high=(0.95, 0.45, 0.075),
        cell_m=0.0125,
        dt_s=7.0e-4,
        gravity_m_s2=117.7,
        bodies=(
            Body(
                volume_m3=pi * ROPE.radius_m**2 * ROPE.length_m,
                density_kg_m3=ROPE.mass_kg / (pi * ROPE.radius_m**2 * ROPE.length_m),
                material=RopeMaterial(fibre_pa=2.5e5, core_m=0.004, yield_strain=0.1),
            ),
        ),
        tools=(sim_finger.Finger(radius_m=FINGER.radius_m, below_m=0.0035, fade_m=0.001),),
        contact_margin_m=0.0035,
        contact_width_m=0.001,
        contact_substeps=3.0,
        damping_1_s=4.0,
    ),
    actions=Pushes(
        region=(0.27, -0.33, 0.83, 0.33),
        height_m=FINGER.push_height_m,
        clearance_m=CLEARANCE_M,
        max_displacement_m=0.010,
        max_length_m=0.18,
        random_length_m=(0.06, 0.16),
        speed_m_s=0.15,
        approach_m_s=0.20,
        push_substeps=240,
        rest_substeps=20,
    ),
    policy=ScriptedPush(
        start_gap_m=CLEARANCE_M + 0.004,
        contact_gap_m=TOUCH_M,
        max_length_m=0.18,
        clearance_m=CLEARANCE_M,
    ),
    symmetry=Symmetry(about_m=(0.55, 0.0), turns=True, mirrored=True, shift_m=(0.08, 0.08)),
    weights=Weights(progress=1.0, contact=0.002, discount=0.7),
    descent=Descent(learning_rate=1.0, clip=1.0, shrink=0.5),
    problems=RopeProblems(rope=ROPE),
    nominal=MappingProxyType({"stiffness": 6.0e4, "table_friction": 0.5, "finger_friction": 0.3}),
    calibrated=("stiffness", "table_friction"),
    aim=Near(limit_m2=2 * 0.012**2),
    ends=Near(limit_m2=2 * 0.010**2),
    horizon=30,
    haste=5.0,
    rods=RodDynamics(
        scene=RodScene(
            length_m=ROPE.length_m,
            radius_m=ROPE.radius_m,
            mass_kg=ROPE.mass_kg,
            finger_radius_m=FINGER.radius_m,
        ),
        # Of the simulated cell, whose rope hops a little as it slides (`bench.rods`).
        physics=MappingProxyType({"climb": 0.5, "press": 0.5, "margin": 2.5e-4}),
        nominal=MappingProxyType({"stiffness": 1.865e4, "table_friction": 0.49, "finger_friction": 0.26}),
        presets=MappingProxyType(
            {
                "cpu": Preset(branches=32, depth=2, particle_count=300, gradient_steps=8),
                "gpu": Preset(branches=256, depth=3, particle_count=2000, gradient_steps=10),
            }
        ),
        push_substeps=1200,
        rest_substeps=150,
    ),
    presets=MappingProxyType(
        {
            "cpu": Preset(branches=8, depth=2, particle_count=300, gradient_steps=5),
            "gpu": Preset(branches=16, depth=3, particle_count=2000, gradient_steps=10),
        }
    ),
)
