"""Recordings of a carried cloth in MuJoCo's world, seen in rendered images, with an effect hidden in them.

Frictions and the cloth's stiffness are drawn, as are the places where it lies and where it is taken. What of a cloth in
the air is seen, and what its folds hide, is no noise: `record` is of cameras that see through it, as `--eyes truth` of
an evaluation, for worlds in which what the arm gets wrong is to be found.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np

from app.commands._hiding import PushRecordingConfig, Stopwatch, record
from app.core.geometry.scene_description import Cloth
from app.discovery.dataset.study import ProjectionView, Study
from app.evaluation.episode import NOISE_M
from app.policy.random_carries import carry_design
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import StampedSnapshot
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks import load
from app.tasks.elements.base import Task
from bench.hidden.draws import Chosen, effects_of
from bench.hidden.unrendered import study_of
from bench.rehearsal import rehearse

_SEEN = 12
"""Stream of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class ClothCase:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects."""

    seed: int
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=lambda: carry_design(6, 5))

    @property
    def task(self) -> Task:
        """The cell's cloth."""
        return load("cloth_hang")

    @property
    def physics(self) -> WorldPhysics:
        """The world's: frictions and stiffness off by up to 30 %."""
        cloth = self.task.stage.body
        assert isinstance(cloth, Cloth)
        return mistune(self.seed, body=cloth)

    @property
    def injected(self) -> tuple[InjectedEffect, ...]:
        """The effects, with directions, places and signs of their own."""
        return effects_of(self.hidden, self.seed, Cloth)

    def record(self) -> Study:
        """The carries as discovery reads them, with the cloth's true particles and the noise of images for clouds."""
        task, rng = self.task, np.random.default_rng([self.seed, _SEEN])
        takes = rehearse(task, self.plan, self.physics, self.injected, self.seed)
        return study_of(task, takes, lambda look: _view(task, look, rng), rng)

    def record_in(self, folder: Path) -> list[Path]:
        """The recordings in a new folder, as `dipac hide` makes them."""
        folder.mkdir(parents=True)
        made = PushRecordingConfig(
            task=self.task, plan=self.plan, physics=self.physics, hidden=self.injected, seed=self.seed, folder=folder
        )
        return list(dict.fromkeys(record(made, Stopwatch())))


def _view(task: Task, look: StampedSnapshot, rng: np.random.Generator) -> ProjectionView:
    """The whole cloth, each particle with the noise of one from images."""
    x = task.particles(look.snapshot.nodes, task.preset("cpu").particle_count)
    noisy = (x + rng.normal(0, NOISE_M, x.shape)).astype(np.float32)
    noisy[:, 2] = np.maximum(noisy[:, 2], 0.0)
    return ProjectionView(time_s=look.stamp_s, points=noisy)
