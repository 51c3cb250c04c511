"""Define a task, bending a rope into half a circle, and let the planner push at it in a simulated cell.

Start it with `python examples/04_task.py`; as `app/tasks/rope_arc.py`, without `add`, it would be `dipac run rope_arc`.
"""

from dataclasses import dataclass, replace
from math import pi
from typing import final

import numpy as np
import tyro

from app.core.dialogue.words import millimetres
from app.core.geometry.scene_description import Rope
from app.core.types import Points
from app.evaluation.episode import EpisodeResults, EvaluationConfig, play
from app.jobs.worker_api import nominal_model
from app.planner.method import DIPAC
from app.tasks import add, load, name_with_dynamics
from app.tasks.elements.base import Nodes
from app.tasks.elements.curves import CurveSampler, fill_tube


@final
@dataclass(frozen=True, kw_only=True)
class ArcProblems:
    """Random starts, and one goal: half a circle in the middle of the table."""

    rope: Rope

    def start(self, seed: int) -> Nodes:
        """A random smooth curve [m]."""
        return CurveSampler().draw(seed, self.rope)[0]

    def goal(self, seed: int, particle_count: int) -> Points:
        """The half circle that is as long as the rope [m], whatever the seed."""
        del seed
        radius_m, angle = self.rope.length_m / pi, np.linspace(-pi / 2, pi / 2, 50)
        circle = np.stack([0.50 + radius_m * np.cos(angle), radius_m * np.sin(angle)], axis=1)
        return self.particles(np.insert(circle, 2, self.rope.radius_m, axis=1), particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """The tube about the centreline, filled evenly [m]."""
        return fill_tube(nodes, self.rope.radius_m, particle_count)


TASK = add(replace(load("rope_push"), name="rope_arc", problems=ArcProblems(rope=load("rope_push").rope), sized=None))


def main(seed: int = 0, pushes: int = 1) -> EpisodeResults:
    """Play the task with its rope as a rod, as `dipac run` does, but in lock step."""
    task, model = load(name_with_dynamics(TASK.name)), nominal_model(name_with_dynamics(TASK.name))
    played = play(EvaluationConfig(task=task, preset="cpu", seed=seed, method=DIPAC, model=model, actions=pushes))
    print(f"{task.name}: {' -> '.join(f'{millimetres(it):.1f}' for it in played.chamfer_m2)} mm from the goal")
    return played


if __name__ == "__main__":
    tyro.cli(main)
