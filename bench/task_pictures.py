"""Pictures of a task: images of a simulated camera during the initial policy's episode, side by side in one file."""

from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Annotated

import cv2
import jax.numpy as jnp
import numpy as np
import tyro

from app.config import Site
from app.core.types import ColourImage
from app.perception.reconstruct import reconstruct
from app.policy.base import PlanningState
from app.rig.simulated.lockstep import LockStep
from app.tasks import Task, load
from bench.approval import approved

_GAP_PX = 6
_SMALLER = 2
_LEVELS = 8
"""Steps of brightness that the eye does not miss, and of which the cameras' noise makes a file three times as large."""


def images(task: Task, seed: int, camera: int) -> list[ColourImage]:
    """Images before and after each action of the policy, until the task is done or its horizon reached."""
    size = task.preset("cpu").particle_count
    cell, goal = LockStep(task.stage, task.start(seed), Site(), seed), task.goal(seed, size)
    seen = list[ColourImage]()
    for made in count():
        frames = cell.look()
        seen.append(frames[camera].color)
        x = reconstruct(frames, task.reconstruction("cpu"), cell.tool).positions
        if made == task.horizon or task.has_ended(x, goal, cell.tool):
            return seen
        now = PlanningState.at_rest(jnp.asarray(x)[None], cell.tool)
        action = task.actions.project(task.policy.act(task.policy.prepare(x, goal), now).mean, now)
        cell.execute(approved(task.actions.motion(np.asarray(action)[0], cell.tool, Site()), x))
    raise AssertionError("counting has no end")


def main(
    task: str = "bean_sweep",
    seed: int = 0,
    camera: int = 0,
    shown: Annotated[int, tyro.conf.arg(help="images, evenly over the episode")] = 4,
    output: Path = Path("docs/images"),
) -> None:
    """Write `OUTPUT/TASK.png`."""
    file = output / f"{task}.png"
    chosen = save(images(load(task), seed, camera), shown, file)
    print(f"{file}: seed {seed}, camera {camera}, before and after {', '.join(map(str, chosen[1:]))} actions")


def save(seen: Sequence[ColourImage], shown: int, file: Path) -> list[int]:
    """Write so many of the images, evenly over all, beside each other; returns which."""
    chosen = [int(index) for index in np.linspace(0, len(seen) - 1, shown).round()]
    small = [_small(seen[index]) for index in chosen]
    gap = np.full((len(small[0]), _GAP_PX, 3), 255, np.uint8)
    row = np.concatenate([part for image in small for part in (image, gap)][:-1], axis=1)
    cv2.imwrite(str(file), cv2.cvtColor(row, cv2.COLOR_RGB2BGR))
    return chosen


def _small(image: ColourImage) -> ColourImage:
    height, width, _ = image.shape
    small = cv2.resize(image, (width // _SMALLER, height // _SMALLER), interpolation=cv2.INTER_AREA)
    return np.asarray(small // _LEVELS * _LEVELS, np.uint8)


if __name__ == "__main__":
    tyro.cli(main)
