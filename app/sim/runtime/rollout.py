"""A whole action as one differentiable JAX operation."""

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, final

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Float

from app.sim.candidates import are_finite, as_float32, where_finite
from app.sim.effects.base import Effect
from app.sim.model.catalogue import EFFECTS
from app.sim.model.scene import Scene
from app.sim.mpm.simd_layout import unpack
from app.sim.runtime.checks import Setup, require_counts, require_shapes
from app.sim.runtime.directions import find_directions
from app.sim.runtime.freed_memory import keep_freed_memory
from app.sim.runtime.launch import make_operations
from app.sim.runtime.order import morton_order, reorder
from app.sim.runtime.schedule import Schedule, schedule_for
from app.sim.state import Setting, State


@jax.tree_util.register_static
@final
@dataclass(frozen=True)
class NeedsGradient:
    """Request for the gradient with respect to phi, known when JAX traces.

    Planning does not need it, and effects at their null cost it nothing then.
    """

    phi: bool


Kept: TypeAlias = tuple[jax.Array, jax.Array, jax.Array, Setting, jax.Array, NeedsGradient]
"""Residuals of the backward pass: phi, history, tool path, setting, mask of finite candidates, and the request."""


class Simulate(Protocol):
    """x' = f(x, u; phi) for B candidates, each with its own parameters, state and tool path."""

    def __call__(
        self,
        phi: Float[jax.Array, "B P"],
        state: State,
        tool: Float[jax.Array, "B T A"],
        setting: Setting | None = None,
    ) -> State:
        """The state after T - 1 substeps, with the tools at coordinates `tool[:, s]` at their boundaries.

        Differentiable once, in reverse mode, with respect to phi, state and tool. A candidate with a non-finite input,
        or a particle that leaves the grid, becomes NaN throughout, and so does its gradient; the others are not
        touched.
        """
        ...


def make_rollout(
    scene: Scene,
    *,
    particle_count: int | tuple[int, ...],
    effects: tuple[Effect, ...] = EFFECTS,
    schedule: Schedule | None = None,
) -> Simulate:
    """The simulator of one scene for bodies of these numbers of particles, for use inside and outside of `jax.jit`.

    Make it once and keep it: every one made holds its own entry in JAX's compilation cache. `schedule`: how
    to launch kernels made for the scene; None: as suits JAX's default platform, on the CPU with all cores.

    Raises ParameterError where a body has no particle.
    """
    counts = (particle_count,) if isinstance(particle_count, int) else tuple(particle_count)
    require_counts(scene, counts)
    if jax.default_backend() == "cpu":
        keep_freed_memory()
    launched = schedule or schedule_for(jax.default_backend(), scene, effects)
    operations = make_operations(scene, counts, launched)
    sizes = Setup(scene=scene, counts=counts, effects=effects).sizes()

    @jax.custom_vjp
    def rollout(phi: jax.Array, state: State, tool: jax.Array, setting: Setting) -> State:
        end = _row(operations.forward(phi, state, tool, setting, 2), (tool.shape[1] - 1) % 2)
        return where_finite(are_finite(phi, end, tool), end)

    def rollout_forward(*given: Any) -> tuple[State, Kept]:
        phi, state, tool, setting = jax.tree.map(_value, given)
        history = operations.forward(phi, state, tool, setting, tool.shape[1])
        end = _row(history, tool.shape[1] - 1)
        finite = are_finite(phi, end, tool)
        return where_finite(finite, end), (phi, history, tool, setting, finite, NeedsGradient(phi=given[0].perturbed))

    def rollout_backward(kept: Kept, end_bar: State) -> tuple[jax.Array, State, jax.Array, Setting]:
        phi, history, tool, setting, finite, sought = kept
        end_bar = jax.tree.map(_instantiate, end_bar, is_leaf=_is_zero)
        state_bar, phi_bar, tool_bar = operations.backward(phi, history, tool, setting, end_bar, sought.phi)
        bars = (phi_bar, state_bar, tool_bar)
        finite_bars = where_finite(finite & are_finite(end_bar) & are_finite(*bars), bars)
        return (*finite_bars, jax.tree.map(jnp.zeros_like, setting))

    rollout.defvjp(rollout_forward, rollout_backward, symbolic_zeros=True)

    def simulate(phi: jax.Array, state: State, tool: jax.Array, setting: Setting | None = None) -> State:
        known = setting or Setting.unknown(phi.shape[0], sizes.particles)
        require_shapes(phi, state, tool, known, sizes)
        phi, state, tool, known = jax.tree.map(as_float32, (phi, state, tool, known))
        known = find_directions(scene, known, state.x)
        if not launched.sorts:
            return rollout(phi, state, tool, known)
        order = jax.lax.stop_gradient(morton_order(state.x, scene.cell_m, counts))
        back = jnp.argsort(order, axis=1)
        own = Setting(label=reorder(known.label, order, back), time=known.time)
        return reorder(rollout(phi, reorder(state, order, back), tool, own), back, order)

    return jax.jit(simulate)


def _row(history: jax.Array, row: int) -> State:
    """The state in one row of the history."""
    return unpack(history[:, row])


def _value(primal: Any) -> jax.Array:
    return primal.value


def _is_zero(leaf: Any) -> bool:
    return isinstance(leaf, SymbolicZero)


def _instantiate(leaf: Any) -> jax.Array:
    return jnp.zeros(leaf.shape, leaf.dtype) if _is_zero(leaf) else leaf
