"""A task's simulator as what discovery doubts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from threadpoolctl import threadpool_limits

from app.core.errors import UsageError
from app.core.geometry.scene_description import Beans, Cloth, Liquid, Soup
from app.core.measured_setup import MeasuredSetup
from app.core.messages import Parameter
from app.discovery.checks.placement import centre
from app.discovery.dataset.bowls import PouredBowls
from app.discovery.dataset.model_under_test import RodModel, Subject, Theta, unknowns_of
from app.discovery.dataset.object_kinds import CLOTH, GRAINS, LIQUID, SOUP
from app.discovery.dataset.study import Study
from app.discovery.inference.screen import refit
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import residuals
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.jobs.jit_cache import nominal_model, phi_of
from app.planner.actions.actions import LOW_ENOUGH_M, Pushes
from app.planner.actions.carry_actions import Carries
from app.planner.actions.pour_actions import Pours
from app.planner.actions.sweep_actions import Sweeps
from app.sim.materials.threads import cloth_at_rest
from app.sim.model.catalogue import discover
from app.sim.model.params import index
from app.sim.model.scene import Scene
from app.sim.tools.bowl import BowlCollider
from app.sim.tools.grasp import Grasp
from app.tasks.elements.base import Task

_SPILT_M: Final = 0.15
"""Farther than a task's grid that spilled drops run."""
_WALL_M: Final = 0.004
"""Wall of the bowls, in which particles may be that are pressed against it."""
_ROUGHER: Final = 1.8
"""Friction of bowls on a task's cells, over that on finer ones: with it two recordings of 24 pours of water in
which nothing is hidden are foretold to 4.2 and 4.6 % of the water, without it to 9.5 and 7.4. It was chosen on bowls
that poured late, before decision 39, and is somewhat too much since: 2 and 3 % too little is foretold."""
_STIFF: Final = 1.5
"""Times the nominal stiffness: a rope that is refitted to be stiffer may be stiffer than the usual rod bears."""
_FITTED_OF_CLOTH: Final = ("stiffness", "table_friction")
"""Parameters of a cloth that are fitted whatever the cause: not the friction of rods, over which none is hung here."""
_PARTICLES_OF_CLOTH, _CELL_M, _SLOWER = 128, 0.04, 1.35
"""Particles and cells of a carried cloth, and its time step over a planner's: half as many particles on a grid as
coarse as they are sparse take a third of the time, and err as much (46 and 45 mm a carry, 10 carries)."""
_HOLD_M: Final = (0.07, 0.04, 0.07)
"""Reach of the gripper's hold, larger than a planner's: a cloth that hangs for seconds tears off a smaller one."""
_FRONT_M, _BELOW_M = -0.60, -0.08
"""Edges of the simulated space along y and z: a cloth swings farther than a gripper goes, and a heap of it sinks in."""
_STIFFER: Final = (1.0, 4.0, 16.0)
"""Whence stiff rods are refitted, as multiples of the limpest of them."""


def subject_of(
    task: Task, setup: MeasuredSetup | None = None, *, stiff: bool = False, priors: Sequence[Parameter] = ()
) -> Subject:
    """Model under test of a task, with the CPU preset's number of particles, simulated as the task is.

    What is a cause of its own is not fitted whatever the cause. `setup`: what imported data say of object and tool; the
    task has their sizes. `stiff`: with the simulator of rods that are stiffer than the usual one bears; its nominal rod
    is as limp as that allows. `priors`: what is known of its parameters beforehand.

    Raises UsageError for a task whose object is neither pushed along a table, nor a cloth that is carried, nor poured.
    """
    match task.stage.body, task.actions:
        case Beans() as beans, Sweeps() as sweeps:
            return _subject_of_grains(task, beans, sweeps, priors)
        case Cloth() as cloth, Carries():
            return _subject_of_cloth(task, cloth, priors)
        case (Liquid() | Soup()) as poured, Pours():
            return _subject_of_liquid(task, poured, priors)
        case _, Pushes():
            pass
        case _:
            raise UsageError(
                f"Discovery reads pushes of a rope, sweeps, carries of a cloth and pours; {task.name} is another task."
            )
    rods = task.rods if task.dynamics == "rods" else None
    causes = _first_parameters_of_causes()
    low_m, unsaid = task.actions.height_m + LOW_ENOUGH_M, frozenset[str]()
    if setup is not None:
        unsaid = frozenset(size.name for size in setup.sizes if size.source != "about")
        low_m = max(low_m, min(setup.push_height_m + LOW_ENOUGH_M, 2 * task.rope.radius_m))
    nominal = phi_of(nominal_model(task.name, priors))
    if stiff:
        nominal[index("stiffness")] = task.parameters(stiff=True)[index("stiffness")].nominal
    return Subject(
        scene=task.scene,
        time_scale=task.time_scale,
        mass_kg=task.rope.mass_kg,
        length_m=task.rope.length_m,
        radius_m=task.rope.radius_m,
        low_m=low_m,
        particle_count=task.preset("cpu").particle_count,
        nominal=nominal,
        calibrated=tuple(name for name in task.calibrated if name not in causes),
        rods=None
        if rods is None
        else RodModel(
            scene=rods.scene_for(stiff=stiff), contact=tuple(rods.physics.items()), unknowns=unknowns_of(unsaid)
        ),
        unsaid=unsaid,
        finger=task.finger,
        priors=tuple(priors),
    )


def _subject_of_grains(task: Task, beans: Beans, sweeps: Sweeps, priors: Sequence[Parameter]) -> Subject:
    """Model under test of loose pieces that a paddle sweeps."""
    causes = _first_parameters_of_causes()
    return Subject(
        scene=task.scene,
        time_scale=task.time_scale,
        mass_kg=beans.mass_kg,
        length_m=beans.length_m,
        radius_m=beans.radius_m,
        low_m=sweeps.height_m + LOW_ENOUGH_M,
        particle_count=task.preset("cpu").particle_count,
        nominal=phi_of(nominal_model(task.name, priors)),
        calibrated=tuple(name for name in task.calibrated if name not in causes),
        kind=GRAINS,
        paddle_half_m=sweeps.half_m,
        priors=tuple(priors),
    )


def _subject_of_cloth(task: Task, cloth: Cloth, priors: Sequence[Parameter]) -> Subject:
    """Model under test of a cloth in a gripper, which touches it wherever it is."""
    grasp, *others = task.scene.tools
    assert isinstance(grasp, Grasp)
    return Subject(
        scene=replace(
            task.scene,
            low=(task.scene.low[0], _FRONT_M, _BELOW_M),
            cell_m=_CELL_M,
            dt_s=task.scene.dt_s * _SLOWER,
            tools=(replace(grasp, reach_m=_HOLD_M), *others),
        ),
        time_scale=task.time_scale,
        mass_kg=cloth.mass_kg,
        length_m=cloth.size_m,
        radius_m=0.0,
        low_m=float("inf"),
        particle_count=_PARTICLES_OF_CLOTH,
        nominal=phi_of(nominal_model(task.name, priors)),
        calibrated=_FITTED_OF_CLOTH,
        kind=CLOTH,
        fingers=task.stage.tool.fingers,
        initial_state=cloth_at_rest,
        priors=tuple(priors),
    )


def _subject_of_liquid(task: Task, poured: Liquid | Soup, priors: Sequence[Parameter]) -> Subject:
    """Model under test of a liquid that is poured, pieces in it as well; its grid reaches as far as drops run."""
    held, (fixed,) = task.perception.held, task.perception.standing
    assert held is not None, task.name
    cells = round(_SPILT_M / task.scene.cell_m) * task.scene.cell_m
    low, high = task.scene.low, task.scene.high
    scene = replace(
        task.scene,
        low=(low[0] - cells, low[1] - cells, low[2]),
        high=(high[0] + cells, high[1] + cells, high[2]),
    )
    if isinstance(poured, Soup):
        scene = _with_stiff_pieces(scene, poured, task.nominal["stiffness"])
    else:
        scene = _with_rougher_bowls(scene)
    return Subject(
        scene=scene,
        time_scale=task.time_scale,
        mass_kg=poured.mass_kg,
        length_m=2 * held.radius_m,
        radius_m=held.radius_m,
        low_m=high[2],
        particle_count=task.preset("cpu").particle_count,
        nominal=phi_of(nominal_model(task.name, priors)),
        calibrated=(),  # The bulk modulus does little to what is poured.
        kind=SOUP if isinstance(poured, Soup) else LIQUID,
        bowls=PouredBowls(
            held_radius_m=held.radius_m,
            place_m=fixed.place_m,
            radius_m=fixed.radius_m,
            wall_m=_WALL_M,
            volume_m3=poured.volume_m3,
        ),
        priors=tuple(priors),
    )


def _with_rougher_bowls(scene: Scene) -> Scene:
    """The scene with bowls as rough as its cells need them."""
    tools = (
        replace(tool, friction=_ROUGHER * tool.friction) if isinstance(tool, BowlCollider) else tool
        for tool in scene.tools
    )
    return replace(scene, tools=tuple(tools))


def _with_stiff_pieces(scene: Scene, soup: Soup, stiffness_pa: float) -> Scene:
    """The scene with pieces as stiff as the soup's are, in the mean by volume, and time steps that bear them.

    A planner's are softened for longer steps, and slide over a lip that stiffer ones dam. `stiffness_pa`: phi's.
    """
    liquid, pieces = scene.bodies
    young_pa = sum(kind.young_pa * kind.volume_m3 for kind in soup.pieces) / soup.solid_m3
    stiff = replace(pieces, stiffness=young_pa / stiffness_pa)
    shorter = max(1.0, float(np.sqrt(stiff.stiffness / pieces.stiffness)))
    return replace(scene, bodies=(liquid, stiff), dt_s=scene.dt_s / shorter)


def _first_parameters_of_causes() -> frozenset[str]:
    """Parameters that are a cause of their own, which is not fitted whatever the cause."""
    return frozenset(effect.parameters[0].name for effect in discover().values() if effect.catalogued)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Doubted:
    """The simulator that is doubted; `about`: its nominal model, refitted to the study, where that is known already."""

    subject: Subject
    about: Theta | None = None


@threadpool_limits.wrap(limits=1, user_api="blas")
def doubted_in(study: Study, task: Task) -> Doubted:
    """The simulator of a task in whose range these pushes are.

    That is the one of stiff rods where the usual one, refitted to them, is stiff or errs more than the stiffest that it
    bears, and a stiff rod errs less: as it is, or refitted, where the usual one is as stiff as it may be. A refit has
    several minima: the nominal rod is the one of `_STIFFER` from which it errs least. Raises as `subject_of`.
    """
    usual = subject_of(task, study.setup, priors=study.priors)
    if usual.rods is None or task.rods is None or task.rods.stiff_scene == usual.rods.scene:
        return Doubted(subject=usual)
    trials, predictor = prepare(centre(study, usual), usual), Predictor(usual, usual.catalogue())
    about, column = refit(predictor, trials), predictor.catalogue.column("stiffness")
    error_m, stiffest = _error_m(predictor, trials, about), about.copy()
    stiffest[column] = predictor.catalogue.specs[column].high
    # A refit to a rope that is much stiffer may end at one that is limp.
    if about[column] < _STIFF * usual.nominal[column] and error_m <= _error_m(predictor, trials, stiffest):
        return Doubted(subject=usual, about=about)
    stiff = subject_of(task, study.setup, stiff=True, priors=study.priors)
    known, least_pa = stiff.catalogue(), float(stiff.nominal[column])
    stiffer = (least_pa * times for times in _STIFFER)
    starts = [Predictor(_as_stiff(stiff, pa), known) for pa in stiffer if pa < known.specs[column].high]
    at_its_end = about[column] >= stiffest[column]
    if not at_its_end and min(_error_m(each, trials, known.nominal(each.subject)) for each in starts) >= error_m:
        return Doubted(subject=usual, about=about)
    found = [(predictor, about), *((start, refit(start, trials)) for start in starts)]
    best, refitted = min(found, key=lambda pair: _error_m(pair[0], trials, pair[1]))
    return Doubted(subject=best.subject, about=refitted)


def _as_stiff(subject: Subject, stiffness_pa: float) -> Subject:
    nominal = subject.nominal.copy()
    nominal[index("stiffness")] = stiffness_pa
    return replace(subject, nominal=nominal)


def _error_m(predictor: Predictor, trials: SimulationBatch, about: Theta) -> float:
    """A model's median residual after a push; infinite of those that cannot be simulated."""
    found = residuals(predictor, trials, about, (), replicas=0)
    simulated = found.known[:, trials.after_rows].any(1)
    return float(np.median(np.where(simulated, np.linalg.norm(found.r[:, trials.after_rows], axis=1), np.inf)))
