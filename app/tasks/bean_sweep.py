"""Sweeping beans on a table onto a mat with a paddle (paper, bean task)."""

from dataclasses import replace
from math import ceil, pi, sqrt
from types import MappingProxyType

from app.core.colours import ColourRange
from app.core.geometry.scene_description import Beans, Body, Stage
from app.core.geometry.shapes.fixtures import Mat
from app.core.geometry.shapes.tools import Paddle
from app.perception.reconstruct import Reconstruction
from app.planner.actions.sweep_actions import Sweeps
from app.planner.search.cost import Weights
from app.planner.search.optimise import OptimizerConfig
from app.policy.scripted_sweep import ScriptedSweep
from app.policy.symmetry import Symmetry
from app.sim.materials.granular import Granular
from app.sim.model.scene import Body as Matter
from app.sim.model.scene import Scene
from app.sim.tools.box import BoxCollider
from app.tasks.elements.base import Preset, Task
from app.tasks.elements.scatter import BeanProblems
from app.tasks.elements.success import OnMat

BEANS = Beans(count=50, length_m=0.016, radius_m=0.005, mass_kg=0.05, colour=(0.62, 0.08, 0.07))
PADDLE = Paddle(half_m=(0.05, 0.005, 0.02), sweep_height_m=0.0215)
# Flat, where a tray could be entered from one side only: a straight sweep takes beans onto it from anywhere, and may
# take them off again on the other side.
MAT = Mat(radius_m=0.08, place_m=(0.55, 0.0))
# A particle lies up to 5 mm inside its bean, and perception errs by up to 3 mm.
CLEARANCE_M = 0.010

SWEEPS = Sweeps(
    region=(0.265, -0.335, 0.835, 0.335),
    height_m=PADDLE.sweep_height_m,
    half_m=PADDLE.half_m[:2],
    clearance_m=CLEARANCE_M,
    length_m=(0.03, 0.40),
    random_length_m=(0.08, 0.30),
    speed_m_s=0.15,
    approach_m_s=0.25,
    sweep_substeps=130,
    rest_substeps=12,
    scale_m=0.015,
)
PROBLEMS = BeanProblems(beans=BEANS, mat=MAT, region=(0.31, -0.29, 0.79, 0.29), goal_m=0.065)

SCATTERED = replace(PROBLEMS, region=(0.30, -0.30, 0.80, 0.30), spills=(1, 1), spread_m=(0.4, 0.5))
"""One spill much wider than the region: beans all over the table, of which a sweep meets few."""


def _material(beans: Beans) -> Matter:
    """The beans as one granular body."""
    volume_m3 = beans.count * pi * beans.radius_m**2 * (beans.length_m - 2 / 3 * beans.radius_m)
    return Matter(
        volume_m3=volume_m3,
        density_kg_m3=beans.mass_kg / volume_m3,
        material=Granular(friction_angle_deg=38.0),
        stiffness=0.1,
    )


def _with_beans(beans: Body) -> Task:
    """The same task with these beans: waves are faster in what is lighter, and time steps as much shorter."""
    assert isinstance(beans, Beans)
    material = _material(beans)
    slower = min(1.0, sqrt(material.density_kg_m3 / _material(BEANS).density_kg_m3))
    sweep, rest = (ceil(count / slower) for count in (SWEEPS.sweep_substeps, SWEEPS.rest_substeps))
    return replace(
        TASK,
        stage=replace(TASK.stage, body=beans),
        scene=replace(TASK.scene, bodies=(material,), dt_s=TASK.scene.dt_s * SWEEPS.sweep_substeps / sweep),
        actions=replace(SWEEPS, sweep_substeps=sweep, rest_substeps=rest),
        problems=replace(PROBLEMS, beans=beans),
    )


def _hard(task: Task) -> Task:
    """The task with hard problems."""
    assert isinstance(task.stage.body, Beans)
    return replace(task, problems=replace(SCATTERED, beans=task.stage.body), horizon=12)


TASK = Task(
    name="bean_sweep",
    stage=Stage(body=BEANS, tool=PADDLE, fixtures=(MAT,)),
    perception=Reconstruction(colour=ColourRange.around(BEANS.colour), particle_count=300, half_width_m=0.007),
    # A real sweep takes 2 s, a simulated one 0.3 s. Three times the weight, and air as thick as syrup, let beans come
    # to rest near the paddle all the same, as they truly do: measured in the simulated cell.
    scene=Scene(
        low=(0.20, -0.40, -0.025),
        high=(0.90, 0.40, 0.075),
        cell_m=0.0125,
        dt_s=2.3e-3,
        gravity_m_s2=30.0,
        bodies=(_material(BEANS),),
        tools=(BoxCollider(half_m=PADDLE.half_m, motion="turns"),),
        contact_margin_m=0.005,
        damping_1_s=15.0,
    ),
    actions=SWEEPS,
    policy=ScriptedSweep(half_m=PADDLE.half_m[:2], gap_m=CLEARANCE_M + 0.002),
    symmetry=Symmetry(about_m=(0.55, 0.0), turns=True, mirrored=True, along="object"),
    weights=Weights(progress=1.0, contact=0.0002),
    descent=OptimizerConfig(learning_rate=1.0, clip=1.0, shrink=0.5),
    problems=PROBLEMS,
    nominal=MappingProxyType({"stiffness": 3.0e4, "table_friction": 0.4, "finger_friction": 0.3}),
    calibrated=("stiffness", "table_friction"),
    success=OnMat(mat=MAT, enough=0.9),
    stop_when=OnMat(mat=MAT, enough=0.98),
    horizon=20,
    with_body=_with_beans,
    hard=_hard,
    time_scale=7.0,
    presets=MappingProxyType(
        {
            "cpu": Preset(branches=48, depth=1, particle_count=300, gradient_steps=6, descended=2, redraws=(8.0, 3.0)),
            "gpu": Preset(branches=150, depth=1, particle_count=300, gradient_steps=10),
        }
    ),
)
