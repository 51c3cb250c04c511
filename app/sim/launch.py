"""Warp launches as JAX calls: a whole action forward, and its adjoint."""

# The annotations of the callables are Warp's run-time array types, which are no static types.
# pyright: reportInvalidTypeForm=false

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, final

import jax
import warp as wp
from jaxtyping import Float

from app.sim.constants import constants_of
from app.sim.effects.base import Effect
from app.sim.kernels import build_kernels
from app.sim.scene import Scene
from app.sim.state import State

History = tuple[Float[jax.Array, "B R N 3"], Float[jax.Array, "B R N 3"], Any, Any]


@final
@dataclass(frozen=True, kw_only=True)
class Operations:
    """The two calls of a rollout, for fixed scene and particle count."""

    forward: Callable[..., Any]
    backward: Callable[..., Any]


def in_threads(threads: int, launch: Callable[[int], None]) -> None:
    """Call `launch(0)` to `launch(threads - 1)` at the same time: Warp's launches release the interpreter lock."""
    if threads == 1:
        launch(0)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(launch, range(threads)))


def cores() -> int:
    """Number of cores this process may use."""
    return len(os.sched_getaffinity(0))


def make_operations(scene: Scene, particle_count: int, effects: tuple[Effect, ...], threads: int) -> Operations:
    """Forward and backward calls; each JAX call of them is one launch a thread."""
    wp.config.log_level = wp.LOG_WARNING  # Warp announces itself on stdout, which belongs to the command line
    kernels = build_kernels(effects)
    k = constants_of(scene, particle_count)
    Phi = kernels.phi_type
    nodes = int(k.nx) * int(k.ny) * int(k.nz)
    listed = min(27 * particle_count, nodes)

    def forward(
        phi: wp.array(dtype=Phi),
        tool: wp.array2d(dtype=wp.vec3),
        x: wp.array2d(dtype=wp.vec3),
        v: wp.array2d(dtype=wp.vec3),
        C: wp.array2d(dtype=wp.mat33),
        F: wp.array2d(dtype=wp.mat33),
        xs: wp.array3d(dtype=wp.vec3),
        vs: wp.array3d(dtype=wp.vec3),
        Cs: wp.array3d(dtype=wp.mat33),
        Fs: wp.array3d(dtype=wp.mat33),
        grid: wp.array2d(dtype=wp.vec4),
        touches: wp.array2d(dtype=wp.vec4),
        active: wp.array2d(dtype=wp.int32),
        active_count: wp.array(dtype=wp.int32),
    ):
        wp.load_module(kernels.advance.module, phi.device)
        for scratch in (grid, touches, active_count):
            scratch.zero_()
        used, steps = grid.shape[0], tool.shape[1] - 1
        arrays = [phi, tool, x, v, C, F, xs, vs, Cs, Fs, grid, touches, active, active_count]

        def launch(first: int) -> None:
            dim = len(range(first, phi.shape[0], used))
            wp.launch(kernels.advance, dim, [k, first, used, steps, *arrays], device=phi.device)

        in_threads(used, launch)

    def backward(
        phi: wp.array(dtype=Phi),
        tool: wp.array2d(dtype=wp.vec3),
        xs: wp.array3d(dtype=wp.vec3),
        vs: wp.array3d(dtype=wp.vec3),
        Cs: wp.array3d(dtype=wp.mat33),
        Fs: wp.array3d(dtype=wp.mat33),
        x_end: wp.array2d(dtype=wp.vec3),
        v_end: wp.array2d(dtype=wp.vec3),
        C_end: wp.array2d(dtype=wp.mat33),
        F_end: wp.array2d(dtype=wp.mat33),
        x_bar: wp.array2d(dtype=wp.vec3),
        v_bar: wp.array2d(dtype=wp.vec3),
        C_bar: wp.array2d(dtype=wp.mat33),
        F_bar: wp.array2d(dtype=wp.mat33),
        phi_bar: wp.array(dtype=Phi),
        tool_bar: wp.array2d(dtype=wp.vec3),
        grid: wp.array2d(dtype=wp.vec4),
        velocity: wp.array2d(dtype=wp.vec4),
        touches: wp.array2d(dtype=wp.vec4),
        grid_bar: wp.array2d(dtype=wp.vec4),
        touches_bar: wp.array2d(dtype=wp.vec4),
        active: wp.array2d(dtype=wp.int32),
        active_count: wp.array(dtype=wp.int32),
    ):
        wp.load_module(kernels.advance.module, phi.device)
        for end, bar in ((x_end, x_bar), (v_end, v_bar), (C_end, C_bar), (F_end, F_bar)):
            wp.copy(bar, end)
        for scratch in (tool_bar, grid, touches, grid_bar, touches_bar, active_count):
            scratch.zero_()
        used, steps = grid.shape[0], tool.shape[1] - 1
        bars = [x_bar, v_bar, C_bar, F_bar, phi_bar, tool_bar]
        arrays = [
            phi,
            tool,
            xs,
            vs,
            Cs,
            Fs,
            *bars,
            grid,
            velocity,
            touches,
            grid_bar,
            touches_bar,
            active,
            active_count,
        ]

        def launch(first: int) -> None:
            dim = len(range(first, phi.shape[0], used))
            wp.launch(kernels.retreat, dim, [k, first, used, steps, *arrays], device=phi.device)

        in_threads(used, launch)

    forward_call = wp.jax_callable(forward, num_outputs=8)
    backward_call = wp.jax_callable(backward, num_outputs=13)

    def scratch_dims(candidates: int) -> dict[str, tuple[int, ...]]:
        used = min(threads, candidates)
        grids = dict.fromkeys(("grid", "velocity", "touches", "grid_bar", "touches_bar"), (used, nodes))
        return grids | {"active": (used, listed), "active_count": (used,)}

    def run_forward(phi: jax.Array, state: State, tool: jax.Array, rows: int) -> tuple[jax.Array, ...]:
        history = dict.fromkeys(("xs", "vs", "Cs", "Fs"), (phi.shape[0], rows, particle_count))
        return tuple(forward_call(phi, tool, *state, output_dims=history | scratch_dims(phi.shape[0]))[:4])

    def run_backward(phi: jax.Array, history: Any, tool: jax.Array, end: State) -> tuple[jax.Array, ...]:
        bars = dict.fromkeys(("x_bar", "v_bar", "C_bar", "F_bar"), (phi.shape[0], particle_count))
        dims = bars | {"phi_bar": phi.shape[:1], "tool_bar": tool.shape[:2]} | scratch_dims(phi.shape[0])
        return tuple(backward_call(phi, tool, *history, *end, output_dims=dims)[:6])

    return Operations(forward=run_forward, backward=run_backward)
