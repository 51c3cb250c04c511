"""Warp launches as JAX calls: a whole action forward, and its adjoint."""

# The annotations of the callables are Warp's run-time array types, which are no static types.
# pyright: reportInvalidTypeForm=false, reportAttributeAccessIssue=false, reportCallIssue=false

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import jax
import warp as wp

from app.sim.constants import constants_of
from app.sim.memory import Grid, GridBars, History, Particles
from app.sim.scene import Scene
from app.sim.schedule import Bars, Schedule, Work
from app.sim.state import State


@final
@dataclass(frozen=True, kw_only=True)
class Operations:
    """The two calls of a rollout.

    `forward(phi, state, tool, rows)` returns the history, `rows` states of which substep s begins at s modulo `rows`.
    `backward(phi, history, tool, end_bar)`, for a history that holds every state, returns the cotangents of the first
    state's four parts, of phi and of tool.
    """

    forward: Callable[[jax.Array, State, jax.Array, int], tuple[jax.Array, ...]]
    backward: Callable[[jax.Array, tuple[jax.Array, ...], jax.Array, State], tuple[jax.Array, ...]]


def make_operations(scene: Scene, particle_count: int, schedule: Schedule) -> Operations:
    """For one scene and number of particles."""
    wp.config.log_level = wp.LOG_WARNING  # Warp announces itself on stdout, which belongs to the command line.
    k = constants_of(scene, particle_count)
    kernels = schedule.kernels
    Phi = kernels.phi_type
    nodes = scene.shape[0] * scene.shape[1] * scene.shape[2]

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
        mass: wp.array2d(dtype=wp.vec4),
        touch: wp.array2d(dtype=wp.vec4),
        active: wp.array2d(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
    ):
        for scratch in (mass, touch, count):
            scratch.zero_()
        # Without an adjoint to come, a node's velocity may take the place of its momentum.
        grid = _struct(Grid, mass=mass, touch=touch, velocity=mass, active=active, count=count)
        history = _struct(History, x=xs, v=vs, C=Cs, F=Fs)
        schedule.forward(Work(k, phi, tool, history, grid), _struct(Particles, x=x, v=v, C=C, F=F))

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
        phi_bar: wp.array2d(dtype=Phi),
        tool_bar: wp.array2d(dtype=wp.vec3),
        mass: wp.array2d(dtype=wp.vec4),
        touch: wp.array2d(dtype=wp.vec4),
        velocity: wp.array2d(dtype=wp.vec4),
        node_bar: wp.array2d(dtype=wp.vec4),
        touch_bar: wp.array2d(dtype=wp.vec4),
        active: wp.array2d(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
    ):
        for end, bar in ((x_end, x_bar), (v_end, v_bar), (C_end, C_bar), (F_end, F_bar)):
            wp.copy(bar, end)
        for scratch in (phi_bar, tool_bar, mass, touch, velocity, node_bar, touch_bar, count):
            scratch.zero_()
        grid = _struct(Grid, mass=mass, touch=touch, velocity=velocity, active=active, count=count)
        history = _struct(History, x=xs, v=vs, C=Cs, F=Fs)
        state_bar = _struct(Particles, x=x_bar, v=v_bar, C=C_bar, F=F_bar)
        grid_bar = _struct(GridBars, node=node_bar, touch=touch_bar)
        schedule.adjoint(Work(k, phi, tool, history, grid), Bars(state_bar, phi_bar, tool_bar, grid_bar))

    forward_call = wp.jax_callable(forward, num_outputs=8)
    backward_call = wp.jax_callable(backward, num_outputs=13)

    def grid_dims(candidates: int) -> dict[str, tuple[int, ...]]:
        slots = schedule.slots(candidates)
        dense = dict.fromkeys(("mass", "touch", "velocity", "node_bar", "touch_bar"), (slots, nodes))
        return dense | {"active": (slots, min(27 * particle_count, nodes)), "count": (slots,)}

    def load() -> None:
        """While JAX traces: a compiler has no place in a running computation, least of all in one being recorded."""
        for device in jax.local_devices():
            wp.load_module(kernels.module, wp.device_from_jax(device))

    def run_forward(phi: jax.Array, state: State, tool: jax.Array, rows: int) -> tuple[jax.Array, ...]:
        load()
        history = dict.fromkeys(("xs", "vs", "Cs", "Fs"), (phi.shape[0], rows, particle_count))
        return tuple(forward_call(phi, tool, *state, output_dims=history | grid_dims(phi.shape[0]))[:4])

    def run_backward(phi: jax.Array, history: Any, tool: jax.Array, end_bar: State) -> tuple[jax.Array, ...]:
        load()
        candidates = phi.shape[0]
        dims = dict.fromkeys(("x_bar", "v_bar", "C_bar", "F_bar"), (candidates, particle_count))
        dims |= {"phi_bar": (candidates, schedule.phi_columns(particle_count)), "tool_bar": tool.shape[:2]}
        outputs = backward_call(phi, tool, *history, *end_bar, output_dims=dims | grid_dims(candidates))
        return (*outputs[:4], outputs[4].sum(axis=1), outputs[5])

    return Operations(forward=run_forward, backward=run_backward)


def _struct(kind: Callable[[], Any], **arrays: wp.array[Any]) -> Any:
    """A Warp struct with its arrays set: Warp's constructors take no arguments."""
    made = kind()
    for name, array in arrays.items():
        setattr(made, name, array)
    return made
