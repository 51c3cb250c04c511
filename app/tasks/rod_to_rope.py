"""Pushing a soft rope through a gap with a model that was calibrated on a rigid rod (paper, transfer: DiPac-Online)."""

from dataclasses import replace
from math import pi
from types import MappingProxyType

from app.core.colours import ColourRange
from app.core.geometry.scene_description import Rope, Stage
from app.core.geometry.shapes.tools import Finger
from app.perception.reconstruct import Reconstruction
from app.planner.actions.actions import Pushes
from app.planner.actions.gap_cost import Passage
from app.planner.search.cost import Weights
from app.planner.search.optimise import OptimizerConfig
from app.policy.scripted_gap import ScriptedGap
from app.policy.symmetry import Symmetry
from app.sim.materials.rope import RopeMaterial
from app.sim.model.scene import Body, Scene
from app.sim.rods.scene import Wall
from app.sim.tools.box import WallsWithGap
from app.sim.tools.finger import FingerCollider
from app.tasks.elements.base import Preset, Task, TrainingVariant
from app.tasks.elements.passing import GappedWall, Passing
from app.tasks.elements.rods import rods_of
from app.tasks.elements.success import Beyond

ROPE = Rope(length_m=0.24, radius_m=0.008, mass_kg=0.0384, colour=(0.80, 0.24, 0.10))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)
WALL = GappedWall(x_m=0.60, gap_m=0.07, reach_m=0.35, height_m=0.04, thickness_m=0.02)

# Beside the rope by 8 mm: perception errs by up to 3 mm, the arm by about 1 mm.
CLEARANCE_M = ROPE.radius_m + FINGER.radius_m + 0.008
TOUCH_M = ROPE.radius_m + FINGER.radius_m
# Beside the walls by 6 mm, of which a displacement that cuts a corner takes up to 4.
KEEP_OUT_M = FINGER.radius_m + 0.006
START_M = (0.43, 0.0)

ROD = replace(ROPE, rigid=True)

NARROW = replace(WALL, gap_m=0.030)
THREADED = Passing(
    rope=ROPE,
    wall=NARROW,
    start_m=(NARROW.x_m, 0.0),
    start_spread_m=(0.0, 0.002),
    start_turn_rad=0.15,
    bend_rad=0.25,
    threaded=(0.60, 0.85),
)
"""Hard starts: a rope of which more than half is through a gap that is less than two of its diameters wide."""


def _walls(wall: GappedWall) -> WallsWithGap:
    """The wall among material points."""
    return WallsWithGap(
        place_m=(wall.x_m, 0.0, 0.0),
        half_length_m=wall.reach_m,
        gap_m=wall.gap_m,
        height_m=wall.height_m,
        thickness_m=wall.thickness_m,
    )


def _hard(task: Task) -> Task:
    """The task with hard problems."""
    assert isinstance(task.actions, Pushes)
    assert task.rods is not None
    half_m = max(NARROW.gap_m / 2 - TOUCH_M, 0.0)
    blocks = Wall.with_gap(NARROW.x_m, NARROW.gap_m, NARROW.reach_m, NARROW.thickness_m)
    return replace(
        task,
        stage=replace(task.stage, fixtures=NARROW.blocks),
        scene=replace(task.scene, tools=(task.scene.tools[0], _walls(NARROW))),
        actions=replace(task.actions, keep_out=NARROW.keep_out(KEEP_OUT_M)),
        weights=replace(task.weights, distance=Passage(x_m=NARROW.x_m, low_m=-half_m, high_m=half_m)),
        problems=THREADED,
        training_variant=TrainingVariant(
            stage=Stage(body=ROD, tool=FINGER, fixtures=NARROW.blocks), problems=replace(THREADED, rope=ROD)
        ),
        rods=replace(task.rods, scene=replace(task.rods.scene, walls=blocks)),
    )


TASK = Task(
    name="rod_to_rope",
    stage=Stage(body=ROPE, tool=FINGER, fixtures=WALL.blocks),
    perception=Reconstruction(colour=ColourRange.around(ROPE.colour), particle_count=180, half_width_m=0.010),
    scene=Scene(
        low=(0.15, -0.45, -0.025),
        high=(0.95, 0.45, 0.075),
        cell_m=0.0125,
        dt_s=3.6e-4,
        gravity_m_s2=117.7,
        bodies=(
            Body(
                volume_m3=pi * ROPE.radius_m**2 * ROPE.length_m,
                density_kg_m3=ROPE.mass_kg / (pi * ROPE.radius_m**2 * ROPE.length_m),
                material=RopeMaterial(fibre_pa=2.5e5, core_m=0.004, yield_strain=0.1),
                stiffness=4.0,
            ),
        ),
        tools=(
            FingerCollider(radius_m=FINGER.radius_m, below_m=0.0035, fade_m=0.001),
            _walls(WALL),
        ),
        contact_margin_m=0.0035,
        contact_width_m=0.001,
        contact_substeps=3.0,
        damping_1_s=4.0,
    ),
    actions=Pushes(
        region=(0.255, -0.33, 0.83, 0.33),
        keep_out=WALL.keep_out(KEEP_OUT_M),
        height_m=FINGER.push_height_m,
        clearance_m=CLEARANCE_M,
        max_displacement_m=0.010,
        max_length_m=0.18,
        random_length_m=(0.06, 0.18),
        speed_m_s=0.15,
        approach_m_s=0.20,
        push_substeps=460,
        rest_substeps=40,
    ),
    policy=ScriptedGap(
        gap_m=(WALL.x_m, 0.0),
        from_m=(0.46, 0.0),
        half_length_m=ROPE.length_m / 2,
        start_gap_m=CLEARANCE_M + 0.004,
        contact_gap_m=TOUCH_M,
        max_length_m=0.18,
    ),
    symmetry=Symmetry(mirrored=True),
    weights=Weights(
        progress=1.0,
        contact=0.002,
        discount=0.7,
        distance=Passage(x_m=WALL.x_m, low_m=-WALL.gap_m / 2 + TOUCH_M, high_m=WALL.gap_m / 2 - TOUCH_M),
    ),
    descent=OptimizerConfig(learning_rate=1.0, clip=1.0, shrink=0.5),
    problems=Passing(rope=ROPE, wall=WALL, start_m=START_M),
    training_variant=TrainingVariant(
        stage=Stage(body=ROD, tool=FINGER, fixtures=WALL.blocks),
        problems=Passing(rope=ROD, wall=WALL, start_m=START_M),
    ),
    nominal=MappingProxyType({"stiffness": 6.0e4, "table_friction": 0.5, "finger_friction": 0.3}),
    calibrated=("stiffness", "table_friction"),
    success=Beyond(x_m=WALL.x_m, enough=0.9),
    horizon=10,
    time_scale=5.0,
    own_dynamics="rods",
    hard=_hard,
    rods=rods_of(
        ROPE,
        FINGER,
        {
            "cpu": Preset(branches=32, depth=1, particle_count=180, gradient_steps=12),
            "gpu": Preset(branches=64, depth=3, particle_count=1200, gradient_steps=10),
        },
        walls=Wall.with_gap(WALL.x_m, WALL.gap_m, WALL.reach_m, WALL.thickness_m),
        stiffest_n_m2=4e-4,
    ),
    presets=MappingProxyType(
        {
            "cpu": Preset(branches=10, depth=1, particle_count=180, gradient_steps=4),
            "gpu": Preset(branches=16, depth=3, particle_count=1200, gradient_steps=10),
        }
    ),
)
