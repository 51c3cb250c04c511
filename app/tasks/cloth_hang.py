"""Hanging a cloth that lies on the table over a rack: grasp, carry, release (paper, cloth task)."""

from dataclasses import replace
from math import ceil, pi, sqrt
from types import MappingProxyType

from app.core.colours import ColourRange
from app.core.geometry.scene_description import Body, Cloth, Stage
from app.core.geometry.shapes.fixtures import Rack
from app.core.geometry.shapes.tools import Gripper
from app.perception.cloud.fuse import Box
from app.perception.reconstruct import Reconstruction
from app.planner.actions.carry_actions import Carries, KeptClear
from app.planner.search.cost import Weights
from app.planner.search.optimise import OptimizerConfig
from app.policy.orthographic_views import OrthographicView
from app.policy.scripted_carry import ScriptedCarry
from app.policy.symmetry import Symmetry
from app.sim.materials.cloth import ClothMaterial
from app.sim.materials.threads import cloth_at_rest
from app.sim.model.scene import Body as Matter
from app.sim.model.scene import Scene
from app.sim.tools.grasp import Grasp
from app.sim.tools.rod import RackCollider
from app.tasks.elements.base import Preset, Task
from app.tasks.elements.sheets import ClothProblems
from app.tasks.elements.success import Hung

CLOTH = Cloth(size_m=0.25, mass_kg=0.0125, colour=(0.15, 0.35, 0.80))
GRIPPER = Gripper(half_m=(0.030, 0.006, 0.025), opening_m=0.040, closed_m=0.012)
RACK = Rack(count=2, spacing_m=0.06, half_length_m=0.20, radius_m=0.010, place_m=(0.55, 0.10, 0.18), friction=0.5)
OPENINGS_M = (0.004, GRIPPER.opening_m)
# The fingers' outer sides, when open, and a centimetre, beside the outer sides of the rods; and above them.
CLEAR = KeptClear(y_m=RACK.place_m[1], half_m=0.082, top_m=0.215)
STEP_M = 0.03

# A grid feels matter as thick as a cell, whatever its thickness is said to be.
_THICK_M = 0.001
# Half of the fingers' width, and a cell to every side: a cloth creeps off a smaller hold (docs/tasks/cloth_hang.md).
_HOLD_M = (0.060, 0.030, 0.030)

CARRIES = Carries(
    low=(0.26, -0.34, 0.006),
    high=(0.84, 0.34, 0.36),
    clear=CLEAR,
    max_displacement_m=STEP_M,
    openings_m=OPENINGS_M,
    speed_m_s=0.20,
    move_substeps=330,
    rest_substeps=100,
)
POLICY = ScriptedCarry(
    rack_y_m=CLEAR.y_m,
    half_m=CLEAR.half_m,
    low_m=0.006,
    approach_m=0.08,
    carry_m=0.32,
    beyond_m=0.12,
    release_m=0.16,
    inset_m=0.012,
    openings_m=OPENINGS_M,
    steps_m=(STEP_M, 0.05),
)
PROBLEMS = ClothProblems(cloth=CLOTH, rack=RACK, middle_m=(0.55, -0.175), shift_m=(0.06, 0.02), turn_rad=0.15)

# Lower: what hangs down by a corner comes nearer to the table.
HARD_RACK = replace(RACK, place_m=(*RACK.place_m[:2], 0.15))


def _material(cloth: Cloth) -> Matter:
    """The cloth as one body."""
    volume_m3 = cloth.size_m**2 * _THICK_M
    return Matter(volume_m3=volume_m3, density_kg_m3=cloth.mass_kg / volume_m3, material=ClothMaterial(), stiffness=0.4)


def _rods(rack: Rack) -> RackCollider:
    """The rack in the planner's scene."""
    return RackCollider(
        count=rack.count,
        spacing_m=rack.spacing_m,
        half_length_m=rack.half_length_m,
        radius_m=rack.radius_m,
        place_m=rack.place_m,
        friction=rack.friction,
        along="x",
    )


def _with_cloth(cloth: Body) -> Task:
    """The same task with this cloth, its edge as far from the rack: waves are faster in what is lighter."""
    assert isinstance(cloth, Cloth)
    material, farther_m = _material(cloth), (cloth.size_m - CLOTH.size_m) / 2
    slower = min(1.0, sqrt(material.density_kg_m3 / _material(CLOTH).density_kg_m3))
    move, rest = (ceil(count / slower) for count in (CARRIES.move_substeps, CARRIES.rest_substeps))
    x, y = PROBLEMS.middle_m
    return replace(
        TASK,
        stage=replace(TASK.stage, body=cloth),
        scene=replace(TASK.scene, bodies=(material,), dt_s=TASK.scene.dt_s * CARRIES.move_substeps / move),
        actions=replace(CARRIES, move_substeps=move, rest_substeps=rest),
        policy=replace(POLICY, beyond_m=POLICY.beyond_m + farther_m),
        problems=replace(PROBLEMS, cloth=cloth, middle_m=(x, y - farther_m)),
    )


def _hard(task: Task) -> Task:
    """The task with hard problems: a cloth that lies corner first, farther aside, and a lower rack."""
    assert isinstance(task.problems, ClothProblems)
    assert isinstance(task.policy, ScriptedCarry)
    assert isinstance(task.actions, Carries)
    x, y = task.problems.middle_m
    up_m = HARD_RACK.place_m[2] - RACK.place_m[2]
    return replace(
        task,
        stage=replace(task.stage, fixtures=(HARD_RACK,)),
        scene=replace(task.scene, tools=(task.scene.tools[0], _rods(HARD_RACK))),
        actions=replace(task.actions, clear=replace(CLEAR, top_m=CLEAR.top_m + up_m)),
        policy=replace(task.policy, carry_m=POLICY.carry_m + up_m, release_m=POLICY.release_m + up_m),
        problems=replace(
            task.problems,
            rack=HARD_RACK,
            middle_m=(x, y + 0.007),
            shift_m=(0.08, 0.005),
            about_rad=pi / 4,
            turn_rad=0.2,
        ),
    )


TASK = Task(
    name="cloth_hang",
    stage=Stage(body=CLOTH, tool=GRIPPER, fixtures=(RACK,)),
    perception=Reconstruction(
        colour=ColourRange.around(CLOTH.colour),
        particle_count=256,
        box=Box(low=(0.20, -0.40, -0.02), high=(0.90, 0.40, 0.47)),
        table_margin_m=-0.02,
        underside="thin",
        voxel_m=0.004,
        hidden_s=0.0,
    ),
    scene=Scene(
        low=(0.15, -0.45, -0.03),
        high=(0.96, 0.45, 0.48),
        cell_m=0.03,
        dt_s=1.4e-3,
        bodies=(_material(CLOTH),),
        tools=(
            Grasp(reach_m=_HOLD_M, closed_m=GRIPPER.closed_m),
            _rods(RACK),
        ),
        contact_margin_m=0.003,
        contact_width_m=0.001,
        damping_1_s=6.0,
    ),
    actions=CARRIES,
    policy=POLICY,
    symmetry=Symmetry(about_m=(0.55, CLEAR.y_m), angles_rad=(0.0, pi), mirrored=True, shift_m=(0.04, 0.0)),
    # Along the rods, which a cloth hangs over on both sides.
    side_view=OrthographicView(low=(0.22, -0.38, 0.0), high=(0.88, 0.38, 0.40), pixel_m=0.008, axes=(1, 2, 0)),
    weights=Weights(progress=1.0, contact=0.0005, discount=0.9, level=False),
    descent=OptimizerConfig(learning_rate=1.0, clip=1.0, shrink=0.5),
    problems=PROBLEMS,
    nominal=MappingProxyType({"stiffness": 8.0e4, "table_friction": 0.5, "finger_friction": 0.3}),
    calibrated=("stiffness", "finger_friction"),
    success=Hung(y_m=CLEAR.y_m, reach_m=0.12, low_m=0.03),
    open_gripper_m=GRIPPER.closed_m + 0.008,
    horizon=60,
    initial_state=cloth_at_rest,
    with_body=_with_cloth,
    hard=_hard,
    at_rest=False,
    presets=MappingProxyType(
        {
            "cpu": Preset(branches=6, depth=3, particle_count=256, gradient_steps=3, descended=2),
            "gpu": Preset(branches=16, depth=3, particle_count=1000, gradient_steps=10),
        }
    ),
)
