"""Rod kernels as JAX calls: a whole action forward, and its adjoint."""

# The annotations of the callables are Warp's run-time array types, which are no static types.
# pyright: reportInvalidTypeForm=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import jax
import jax.numpy as jnp
import numpy as np
import warp as wp

from app.sim.rods.kernels import BAR_ROWS, EVERY, FIELDS, FINGER, LANES, ROWS, THREADS, TOOL, rod_kernels
from app.sim.rods.scene import RodScene, factors_of, numbers_of, smoother_of, smoothing_of
from app.sim.rods.state import STATE
from app.sim.runtime.calls import make_warp_call
from app.sim.runtime.threads import core_count, run_jobs


@final
@dataclass(frozen=True, kw_only=True)
class RodOperations:
    """The calls of a rollout of rods.

    `forward(start, fields, traits, tool, spans)` returns the end: `spans` (B, 2) are the first time step of each
    candidate and the one that it ends before. `kept_forward(start, fields, traits, tool)` makes all steps, and returns
    the end and what the adjoint needs;
    `backward(kept, start, fields, traits, tool, end_bar)` the cotangents of start, fields, traits and tool;
    `states(start, fields, traits, tool)` every state from the start to the end, shape (B, T, 8, n).
    """

    forward: Callable[..., jax.Array]
    kept_forward: Callable[..., tuple[jax.Array, jax.Array]]
    states: Callable[..., jax.Array]
    backward: Callable[..., tuple[jax.Array, jax.Array, jax.Array, jax.Array]]


def make_rod_operations(scene: RodScene, bending_n_m: float, damping_n_m_s: float, laws: str = "") -> RodOperations:
    """Operations for a scene, bounds on its joints' stiffness and damping, and laws of effects (`laws.law_source`)."""
    wp.config.log_level = wp.LOG_WARNING
    n = scene.nodes
    smoothing = smoothing_of(scene, bending_n_m, damping_n_m_s)
    numbers = np.array(numbers_of(scene, smoothing), np.float32)
    matrix = smoother_of(scene, smoothing)
    on_gpu = jax.default_backend() == "gpu"
    kernels = rod_kernels(on_gpu=on_gpu, laws=laws)
    smoother = (np.linalg.inv(matrix) if on_gpu else factors_of(matrix)).astype(np.float32).ravel()
    width, every = LANES[on_gpu], EVERY[on_gpu]
    threads = core_count()

    def groups_of(candidates: int) -> int:
        return -(-candidates // width)

    def launch(kernel: wp.Kernel, groups: int, arguments: list[Any], device: wp.Device) -> None:
        if device.is_cuda:
            wp.launch(kernel, groups * THREADS, [0, 0, *arguments], device=device, block_dim=THREADS)
            return

        def simulate(group: int, slot: int) -> None:
            wp.launch(kernel, 1, [group, slot, *arguments], device=device)

        run_jobs(groups, threads, simulate)

    def forward(
        constants: wp.array(dtype=float),
        smoothing: wp.array(dtype=float),
        start: wp.array3d(dtype=float),
        fields: wp.array3d(dtype=float),
        traits: wp.array(dtype=float),
        tool: wp.array3d(dtype=float),
        spans: wp.array2d(dtype=int),
        rows: int,
        apart: int,
        end: wp.array3d(dtype=float),
        kept: wp.array(dtype=float),
        scratch: wp.array(dtype=float),
    ):
        groups = groups_of(start.shape[0])
        arguments = [constants, smoothing, start, fields, traits, tool, spans, scratch, kept, rows, apart, end]
        launch(kernels.forward, groups, arguments, start.device)

    def backward(
        constants: wp.array(dtype=float),
        smoothing: wp.array(dtype=float),
        start: wp.array3d(dtype=float),
        fields: wp.array3d(dtype=float),
        traits: wp.array(dtype=float),
        tool: wp.array3d(dtype=float),
        kept: wp.array(dtype=float),
        end_bar: wp.array3d(dtype=float),
        rows: int,
        start_bar: wp.array3d(dtype=float),
        fields_bar: wp.array3d(dtype=float),
        traits_bar: wp.array(dtype=float),
        tool_bar: wp.array3d(dtype=float),
        between: wp.array(dtype=float),
        scratch: wp.array(dtype=float),
    ):
        tool_bar.zero_()
        groups = groups_of(start.shape[0])
        given = [constants, smoothing, start, fields, traits, tool, scratch, kept, rows, between, end_bar]
        launch(kernels.adjoint, groups, [*given, start_bar, fields_bar, traits_bar, tool_bar], start.device)

    made_for = scene, bending_n_m, damping_n_m_s, laws
    forward_call = make_warp_call(forward, made_for, num_outputs=3)
    backward_call = make_warp_call(backward, made_for, num_outputs=6)

    def slots(candidates: int) -> int:
        groups = groups_of(candidates)
        return groups if on_gpu else min(threads, groups)

    def compiled() -> None:
        for device in jax.local_devices():
            wp.load_module(kernels.module, wp.device_from_jax(device))

    def run(
        inputs: tuple[jax.Array, ...], spans: jax.Array | None = None, rows: int = 0, apart: int = 1
    ) -> tuple[jax.Array, jax.Array]:
        compiled()
        start, fields, traits, tool = inputs
        candidates = start.shape[0]
        dims = {
            "end": start.shape,
            "kept": (max(1, groups_of(candidates) * rows * STATE * n * width),),
            "scratch": (slots(candidates) * ((ROWS + BAR_ROWS) * n + traits.shape[1] + FINGER) * width,),
        }
        constants = jnp.asarray(numbers), jnp.asarray(smoother)
        whole = jnp.tile(jnp.array([[0, tool.shape[1] - 1]], jnp.int32), (groups_of(candidates), 1))
        given = start, fields, traits.ravel(), tool, whole if spans is None else of_groups(spans)
        end, kept, _ = forward_call(*constants, *given, numbers=(rows, apart), output_dims=dims)
        return end, kept

    def of_groups(spans: jax.Array) -> jax.Array:
        """The time steps that some candidate of a group makes, shape (groups, 2)."""
        whole = jnp.pad(spans.astype(jnp.int32), ((0, -len(spans) % width), (0, 0)), mode="edge")
        grouped = whole.reshape(-1, width, 2)
        return jnp.stack([grouped[..., 0].min(1), grouped[..., 1].max(1)], axis=1)

    def run_forward(
        start: jax.Array, fields: jax.Array, traits: jax.Array, tool: jax.Array, spans: jax.Array | None = None
    ) -> jax.Array:
        return run((start, fields, traits, tool), spans)[0]

    def run_kept_forward(
        start: jax.Array, fields: jax.Array, traits: jax.Array, tool: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        return run((start, fields, traits, tool), rows=-(-(tool.shape[1] - 1) // every), apart=every)

    def run_states(start: jax.Array, fields: jax.Array, traits: jax.Array, tool: jax.Array) -> jax.Array:
        rows = tool.shape[1] - 1
        end, kept = run((start, fields, traits, tool), rows=rows)
        lanes = kept.reshape(groups_of(len(start)), rows, STATE, n, width)
        states = jnp.moveaxis(lanes, -1, 1).reshape(-1, rows, STATE, n)
        return jnp.concatenate([states[: len(start)], end[:, None]], axis=1)

    def run_backward(
        kept: jax.Array, start: jax.Array, fields: jax.Array, traits: jax.Array, tool: jax.Array, end_bar: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
        compiled()
        candidates, steps = start.shape[0], tool.shape[1] - 1
        dims = {
            "start_bar": (candidates, STATE, n),
            "fields_bar": (candidates, FIELDS, n),
            "traits_bar": (traits.size,),
            "tool_bar": (candidates, steps + 1, TOOL),
            "between": (slots(candidates) * every * STATE * n * width,),
            "scratch": (slots(candidates) * ((ROWS + BAR_ROWS) * n + traits.shape[1] + FINGER) * width,),
        }
        rows = -(-steps // every)
        start_bar, fields_bar, traits_bar, tool_bar, *_ = backward_call(
            jnp.asarray(numbers),
            jnp.asarray(smoother),
            start,
            fields,
            traits.ravel(),
            tool,
            kept,
            end_bar,
            numbers=(rows,),
            output_dims=dims,
        )
        return start_bar, fields_bar, traits_bar.reshape(traits.shape), tool_bar

    return RodOperations(forward=run_forward, kept_forward=run_kept_forward, states=run_states, backward=run_backward)
