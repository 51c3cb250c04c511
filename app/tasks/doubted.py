"""A task's simulator as what discovery doubts."""

from app.core.errors import UsageError
from app.discovery.subject import RodModel, Subject
from app.planner.actions import LOW_ENOUGH_M, Pushes
from app.sim.catalogue import discover
from app.tasks.base import Task
from app.tasks.compiled import nominal_model, phi_of


def subject_of(task: Task) -> Subject:
    """With the CPU preset's number of particles, and simulated as the task is: as a rod, of TASK@rods.

    What is a cause of its own is not fitted whatever the cause. Raises UsageError for a task without pushes.
    """
    if not isinstance(task.actions, Pushes):
        raise UsageError(f"Discovery reads pushes so far; {task.name} has none.")
    rods = task.rods if task.dynamics == "rods" else None
    causes = {effect.parameters[0].name for effect in discover().values() if effect.catalogued}
    return Subject(
        scene=task.scene,
        haste=task.haste,
        mass_kg=task.rope.mass_kg,
        length_m=task.rope.length_m,
        radius_m=task.rope.radius_m,
        low_m=task.actions.height_m + LOW_ENOUGH_M,
        particle_count=task.preset("cpu").particle_count,
        nominal=phi_of(nominal_model(task.name)),
        calibrated=tuple(name for name in task.calibrated if name not in causes),
        rods=None if rods is None else RodModel(scene=rods.scene, contact=tuple(rods.physics.items())),
    )
