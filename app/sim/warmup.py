"""Compiles the kernels ahead of their first use, by name, so that nobody waits without knowing for what."""

from collections.abc import Callable

import jax
import warp as wp

from app.sim.catalogue import EFFECTS
from app.sim.effects.base import Effect
from app.sim.kernels import build_kernels


def warm_up(announce: Callable[[str], None], effects: tuple[Effect, ...] = EFFECTS) -> None:
    """Compile the simulator for JAX's default device, or load it from Warp's cache on disk.

    `announce` is told the stage's name before it starts, for example "simulator kernels, CPU".
    """
    device = wp.device_from_jax(jax.devices()[0])
    announce(f"simulator kernels, {'CUDA' if device.is_cuda else 'CPU'}")
    wp.load_module(build_kernels(effects).advance.module, device)
