"""Compilation of the kernels ahead of their first use, by name, so that progress can be shown."""

from collections.abc import Callable

import jax
import warp as wp

from app.sim.effects.base import Effect
from app.sim.model.catalogue import EFFECTS
from app.sim.model.scene import Scene
from app.sim.runtime.schedule import schedule_for


def warm_up(announce: Callable[[str], None], scene: Scene, effects: tuple[Effect, ...] = EFFECTS) -> None:
    """Compile the simulator of scenes like this one for JAX's default platform, or load it from Warp's cache on disk.

    `announce` is told the stage's name before it starts, for example "simulator kernels, CPU".
    """
    wp.config.log_level = wp.LOG_WARNING  # Warp announces itself on stdout, which belongs to the command line.
    platform = jax.default_backend()
    announce(f"simulator kernels, {'CPU' if platform == 'cpu' else 'CUDA'}")
    modules = list(schedule_for(platform, scene, effects).modules)
    wp.force_load(wp.device_from_jax(jax.devices()[0]), modules, max_workers=len(modules))
