"""A task's simulator as what discovery doubts."""

from app.core.errors import UsageError
from app.core.measured_setup import MeasuredSetup
from app.discovery.subject import RodModel, Subject, unknowns_of
from app.planner.actions import LOW_ENOUGH_M, Pushes
from app.sim.catalogue import discover
from app.tasks.base import Task
from app.tasks.compiled import nominal_model, phi_of


def subject_of(task: Task, setup: MeasuredSetup | None = None) -> Subject:
    """With the CPU preset's number of particles, and simulated as the task is: as a rod, of TASK@rods.

    What is a cause of its own is not fitted whatever the cause. `setup`: what imported data say of object and tool; the
    task has their sizes. Raises UsageError for a task without pushes.
    """
    if not isinstance(task.actions, Pushes):
        raise UsageError(f"Discovery reads pushes so far; {task.name} has none.")
    rods = task.rods if task.dynamics == "rods" else None
    causes = {effect.parameters[0].name for effect in discover().values() if effect.catalogued}
    low_m, unsaid = task.actions.height_m + LOW_ENOUGH_M, frozenset[str]()
    if setup is not None:
        unsaid = frozenset(size.name for size in setup.sizes if size.source != "about")
        low_m = max(low_m, min(setup.push_height_m + LOW_ENOUGH_M, 2 * task.rope.radius_m))
    return Subject(
        scene=task.scene,
        haste=task.haste,
        mass_kg=task.rope.mass_kg,
        length_m=task.rope.length_m,
        radius_m=task.rope.radius_m,
        low_m=low_m,
        particle_count=task.preset("cpu").particle_count,
        nominal=phi_of(nominal_model(task.name)),
        calibrated=tuple(name for name in task.calibrated if name not in causes),
        rods=None
        if rods is None
        else RodModel(scene=rods.scene, contact=tuple(rods.physics.items()), unknowns=unknowns_of(unsaid)),
        unsaid=unsaid,
        finger=task.finger,
    )
