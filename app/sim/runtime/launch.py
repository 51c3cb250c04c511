"""Warp launches as JAX calls: a whole action forward, and its adjoint."""

# The annotations of the callables are Warp's run-time array types, which are no static types.
# pyright: reportInvalidTypeForm=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, final

import jax
import jax.numpy as jnp
import warp as wp

from app.sim.codegen.tool_composition import parts
from app.sim.constants import BLOCK_NODES, Constants
from app.sim.effect_composition import columns
from app.sim.model.params import NOMINAL_PHYSICS
from app.sim.model.scene import Scene
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.simd_layout import QUADS, pack, unpack
from app.sim.runtime.calls import make_warp_call
from app.sim.runtime.device_constants import block_count_of, constants_of
from app.sim.runtime.memory_estimate import bytes_of, require
from app.sim.runtime.schedule import Bars, Schedule, Work
from app.sim.state import Setting, State


@final
@dataclass(frozen=True, kw_only=True)
class Operations:
    """The two calls of a rollout.

    `forward(phi, state, tool, setting, rows)` returns the history, `rows` states of which substep s begins at s modulo
    `rows`, packed. `backward(phi, history, tool, setting, end_bar, every)`, for a history that holds every state,
    returns the cotangents of the first state, of phi and of tool; those of effects at their nulls if `every` is set.
    """

    forward: Callable[[jax.Array, State, jax.Array, Setting, int], jax.Array]
    backward: Callable[[jax.Array, jax.Array, jax.Array, Setting, State, bool], tuple[State, jax.Array, jax.Array]]


def make_operations(scene: Scene, counts: Sequence[int], schedule: Schedule) -> Operations:
    """Operations for one scene and the numbers of particles of its bodies."""
    wp.config.log_level = wp.LOG_WARNING  # Warp announces itself on stdout, which belongs to the command line.
    pieces = schedule.pieces
    types = pieces.types
    PhiGrain, PhiNode, Pose = types.PhiGrain, types.PhiNode, types.Pose
    _, primitives, coordinates = parts(scene.tools)
    chosen = columns(NOMINAL_PHYSICS, pieces.code.effects)
    particle_count = sum(counts)
    block_count = block_count_of(scene)

    @cache
    def constants(device: str) -> Constants:
        return constants_of(scene, counts, primitives, wp.get_device(device))

    def forward(
        phi_grain: wp.array(dtype=PhiGrain),
        phi_node: wp.array(dtype=PhiNode),
        tool: wp.array2d(dtype=Pose),
        label: wp.array2d(dtype=wp.vec4),
        time: wp.array(dtype=wp.float32),
        start: wp.array4d(dtype=wp.vec4),
        history: wp.array4d(dtype=wp.vec4),
        mass: wp.array2d(dtype=wp.vec4),
        touch: wp.array2d(dtype=wp.vec4),
        aim: wp.array2d(dtype=wp.vec4),
        listed: wp.array2d(dtype=wp.int32),
        felt: wp.array2d(dtype=wp.int32),
        active: wp.array2d(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        arrived: wp.array(dtype=wp.int32),
    ):
        for scratch in (mass, touch, aim, listed, felt, count, arrived):
            scratch.zero_()
        inputs = _struct(
            types.Inputs, phi_grain=phi_grain, phi_node=phi_node, tool=tool, label=label, time=time, every=0
        )
        # Without an adjoint to come, a node's velocity may take the place of its momentum.
        grid = _struct(
            Grid,
            mass=mass,
            touch=touch,
            aim=aim,
            velocity=mass,
            listed=listed,
            felt=felt,
            active=active,
            count=count,
            arrived=arrived,
        )
        schedule.forward(Work(constants(start.device.alias), inputs, history, grid), start)

    def backward(
        phi_grain: wp.array(dtype=PhiGrain),
        phi_node: wp.array(dtype=PhiNode),
        tool: wp.array2d(dtype=Pose),
        label: wp.array2d(dtype=wp.vec4),
        time: wp.array(dtype=wp.float32),
        history: wp.array4d(dtype=wp.vec4),
        end_bar: wp.array4d(dtype=wp.vec4),
        every: wp.int32,
        state_bar: wp.array4d(dtype=wp.vec4),
        grain_bar: wp.array2d(dtype=PhiGrain),
        node_bar: wp.array2d(dtype=PhiNode),
        tool_bar: wp.array2d(dtype=Pose),
        mass: wp.array2d(dtype=wp.vec4),
        touch: wp.array2d(dtype=wp.vec4),
        aim: wp.array2d(dtype=wp.vec4),
        velocity: wp.array2d(dtype=wp.vec4),
        grid_bar: wp.array2d(dtype=wp.vec4),
        touch_bar: wp.array2d(dtype=wp.vec4),
        aim_bar: wp.array2d(dtype=wp.vec4),
        listed: wp.array2d(dtype=wp.int32),
        felt: wp.array2d(dtype=wp.int32),
        active: wp.array2d(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        arrived: wp.array(dtype=wp.int32),
    ):
        wp.copy(state_bar, end_bar)
        sums = grain_bar, node_bar, tool_bar
        for scratch in (*sums, mass, touch, aim, velocity, grid_bar, listed, felt, count, arrived):
            scratch.zero_()
        inputs = _struct(
            types.Inputs, phi_grain=phi_grain, phi_node=phi_node, tool=tool, label=label, time=time, every=every
        )
        grid = _struct(
            Grid,
            mass=mass,
            touch=touch,
            aim=aim,
            velocity=velocity,
            listed=listed,
            felt=felt,
            active=active,
            count=count,
            arrived=arrived,
        )
        grid_bars = _struct(GridBars, node=grid_bar, touch=touch_bar, aim=aim_bar)
        work = Work(constants(history.device.alias), inputs, history, grid)
        schedule.adjoint(work, Bars(state_bar, grain_bar, node_bar, tool_bar, grid_bars))

    made_for = pieces.code, scene, tuple(counts), schedule
    forward_call = make_warp_call(forward, made_for, num_outputs=9)
    backward_call = make_warp_call(backward, made_for, num_outputs=16)

    def grid_dims(candidates: int, *, backwards: bool) -> dict[str, tuple[int, ...]]:
        slots, lists = schedule.slots(candidates, backwards=backwards), schedule.lists(candidates)
        nodes = ("mass", "touch", "aim", "velocity", "grid_bar", "touch_bar", "aim_bar")
        dims: dict[str, tuple[int, ...]] = dict.fromkeys(nodes, (slots, block_count * BLOCK_NODES))
        return dims | {
            "felt": (slots, block_count),
            "listed": (lists, block_count),
            "active": (lists, block_count),
            "count": (lists,),
            "arrived": (lists,),
        }

    def plan(candidates: int, rows: int, *, backwards: bool) -> None:
        needed = bytes_of(schedule, particles=particle_count, blocks=block_count, rows=rows, backwards=backwards)
        require(needed, candidates, jax.local_devices()[0])

    def inputs(phi: jax.Array, tool: jax.Array, setting: Setting, *, backwards: bool) -> tuple[jax.Array, ...]:
        """Arrays that the kernels read.

        Compiles while JAX traces: a compiler has no place in a computation that is recorded.
        """
        module = schedule.module(phi.shape[0], particle_count, backwards=backwards)
        for device in jax.local_devices():
            on = wp.device_from_jax(device)
            wp.load_module(module, on)
            constants(on.alias)
        path = tool if coordinates else jnp.zeros((*tool.shape[:2], 1), tool.dtype)
        return phi[:, jnp.array(chosen.grain)], phi[:, jnp.array(chosen.node)], path, *setting

    def run_forward(phi: jax.Array, state: State, tool: jax.Array, setting: Setting, rows: int) -> jax.Array:
        candidates = phi.shape[0]
        plan(candidates, rows, backwards=rows == tool.shape[1])  # A whole history is kept for an adjoint to come.
        dims = grid_dims(candidates, backwards=False) | {"history": (candidates, rows, QUADS, particle_count)}
        return forward_call(*inputs(phi, tool, setting, backwards=False), pack(state)[:, None], output_dims=dims)[0]

    def run_backward(
        phi: jax.Array, history: jax.Array, tool: jax.Array, setting: Setting, end_bar: State, every: bool
    ) -> tuple[State, jax.Array, jax.Array]:
        candidates = phi.shape[0]
        plan(candidates, tool.shape[1], backwards=True)
        grain_columns, node_columns = schedule.columns(candidates, particle_count)
        dims = grid_dims(candidates, backwards=True) | {
            "state_bar": (candidates, 1, QUADS, particle_count),
            "grain_bar": (candidates, grain_columns),
            "node_bar": (candidates, node_columns),
            "tool_bar": tool.shape[:2],
        }
        given = inputs(phi, tool, setting, backwards=True)
        state_bar, grain_bar, node_bar, tool_bar, *_ = backward_call(
            *given, history, pack(end_bar)[:, None], numbers=(int(every),), output_dims=dims
        )
        phi_bar = jnp.zeros_like(phi)
        for bar, own in ((grain_bar, chosen.grain), (node_bar, chosen.node)):
            phi_bar = phi_bar.at[:, jnp.array(own)].add(bar.sum(axis=1).reshape(candidates, -1))
        return unpack(state_bar[:, 0]), phi_bar, tool_bar.reshape(*tool.shape[:2], -1)[..., :coordinates]

    return Operations(forward=run_forward, backward=run_backward)


def _struct(kind: Callable[[], Any], **arrays: Any) -> Any:
    """A Warp struct with its arrays set: Warp's constructors take no arguments."""
    made = kind()
    for name, array in arrays.items():
        setattr(made, name, array)
    return made
