"""World in which something is hidden: its physics and the injected effects, as a sealed file has them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from app.core.errors import UsageError
from app.core.geometry.scene_description import Body, Rope
from app.core.task_name import TaskName
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import WorldPhysics


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class HiddenWorld:
    """`physics` with its frictions and stiffness, and the effects in it; of a rope's chain of bodies."""

    physics: WorldPhysics
    effects: tuple[InjectedEffect, ...]

    @property
    def in_images(self) -> tuple[str, ...]:
        """Names of the effects that only rendered images have: those of the cameras."""
        return tuple(each.name for each in self.effects if each.effect.stands or each.effect.seen)

    @property
    def in_motion(self) -> tuple[str, ...]:
        """Names of the effects that only a view of something that moves has: those of when images are taken."""
        return tuple(each.name for each in self.effects if each.effect.late_s is not None)

    @property
    def more(self) -> float:
        """Share of a liquid's volume by which there is more of it than its task says."""
        return Intrusion(self.effects).more

    def __str__(self) -> str:
        """Friction and the effects' values, by which two worlds can be told apart."""
        effects = [f"{each.name} {' '.join(f'{value:.6g}' for value in each.values)}" for each in self.effects]
        return ", ".join([*effects, f"friction {self.physics.table_friction:.6g}"])


def load_hidden_world(path: Path, task: str, body: Body) -> HiddenWorld:
    """The world of a sealed file of `dipac hide`, for the task of this full name with this object.

    Raises UsageError where it cannot be read, is of another task, or names an effect that nobody can hide there.
    """
    try:
        truth = json.loads(path.read_text(encoding="utf-8"))
        recorded, seed = TaskName.parse(truth["task"]), int(truth["seed"])
        if seed < 0:
            raise ValueError(f"seed {seed} is negative")
        effects = tuple(_effect(each, body) for each in truth["effects"])
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}; name the sealed file that `dipac hide` wrote.") from None
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{path} is no sealed file of `dipac hide` ({error!r}); name the file of its truth.") from None
    from app.rig.simulated.effect_sampling import check_world, mistune  # Loads JAX, as the next one.

    played = TaskName.parse(task)
    if (recorded.problem, recorded.sizes) != (played.problem, played.sizes):
        raise UsageError(f"{path} is about {truth['task']}, not about {task}; choose that task.")
    if isinstance(body, Rope):
        check_world(effects, body.model)
        return HiddenWorld(physics=mistune(seed, body.model, body), effects=effects)
    return HiddenWorld(physics=mistune(seed, body=body), effects=effects)


def _effect(told: Mapping[str, Any], body: Body) -> InjectedEffect:
    """An effect with its values. Raises UsageError, ValueError or KeyError for one that cannot be hidden."""
    from app.rig.simulated.effect_sampling import injectable_effects

    name, known = told["effect"], injectable_effects()
    if name not in known:
        raise UsageError.unknown("effect", name, known)
    if not isinstance(body, known[name].bodies):
        raise UsageError(f"{name} is nothing that {type(body).__name__} can have.")
    values = [float(told["parameters"][quantity.name]["value"]) for quantity in known[name].quantities]
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has a value that is not finite")
    return InjectedEffect(name=name, effect=known[name], values=np.array(values))
