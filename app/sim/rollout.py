"""A whole action as one differentiable JAX operation."""

from typing import Protocol, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

from app.core.errors import ParameterError
from app.sim.catalogue import EFFECTS
from app.sim.effects.base import Effect
from app.sim.launch import make_operations
from app.sim.params import parameters_with
from app.sim.scene import Scene
from app.sim.schedule import Schedule, schedule_for
from app.sim.state import State

TreeT = TypeVar("TreeT")
Kept: TypeAlias = tuple[jax.Array, tuple[jax.Array, ...], jax.Array, jax.Array]
"""For the backward pass: phi, the history of the particles, the tool path, and which candidates are finite."""


class Simulate(Protocol):
    """x' = f(x, u; phi) for B candidates, each with its own parameters, state and tool path."""

    def __call__(self, phi: Float[jax.Array, "B P"], state: State, tool: Float[jax.Array, "B T 3"]) -> State:
        """The state after T - 1 substeps, with the finger's tip at `tool[:, s]` [m] at their boundaries.

        Differentiable once, in reverse mode, with respect to all three. A candidate with a non-finite input, or a
        particle that leaves the grid, becomes NaN throughout, and so does its gradient; the others are not touched.
        """
        ...


def make_rollout(
    scene: Scene,
    *,
    particle_count: int,
    effects: tuple[Effect, ...] = EFFECTS,
    schedule: Schedule | None = None,
) -> Simulate:
    """The simulator of one scene for objects of `particle_count` particles, for use inside and outside of `jax.jit`.

    Make it once and keep it: every one made holds its own entry in JAX's compilation cache. `schedule`: how
    to launch kernels made with the same effects; None: as suits JAX's default platform, on the CPU with all cores.

    Raises ParameterError where there is no particle.
    """
    if particle_count < 1:
        raise ParameterError(f"particle_count = {particle_count} must be at least 1.")
    operations = make_operations(scene, particle_count, schedule or schedule_for(jax.default_backend(), effects))
    parameter_count = len(parameters_with(effects))

    @jax.custom_vjp
    def rollout(phi: jax.Array, state: State, tool: jax.Array) -> State:
        end = _row(operations.forward(phi, state, tool, 2), (tool.shape[1] - 1) % 2)
        return _where_finite(_finite(phi, end, tool), end)

    def rollout_forward(phi: jax.Array, state: State, tool: jax.Array) -> tuple[State, Kept]:
        history = operations.forward(phi, state, tool, tool.shape[1])
        end = _row(history, tool.shape[1] - 1)
        finite = _finite(phi, end, tool)
        return _where_finite(finite, end), (phi, history, tool, finite)

    def rollout_backward(kept: Kept, end_bar: State) -> tuple[jax.Array, State, jax.Array]:
        phi, history, tool, finite = kept
        *state_bar, phi_bar, tool_bar = operations.backward(phi, history, tool, end_bar)
        bars = (phi_bar, State(*state_bar), tool_bar)
        return _where_finite(finite & _finite(end_bar) & _finite(*bars), bars)

    rollout.defvjp(rollout_forward, rollout_backward)

    def simulate(phi: jax.Array, state: State, tool: jax.Array) -> State:
        _require_shapes(phi, state, tool, (parameter_count, particle_count))
        return rollout(*jax.tree.map(_float32, (phi, state, tool)))

    return simulate


def _row(history: tuple[jax.Array, ...], row: int) -> State:
    """The state in one row of the history."""
    return State(*(leaf[:, row] for leaf in history))


def _float32(leaf: jax.Array) -> jax.Array:
    return jnp.asarray(leaf, jnp.float32)


def _finite(*tree: jax.Array | State) -> Bool[jax.Array, " B"]:
    """Which candidates are finite in every number."""
    flags = [jnp.isfinite(leaf).all(axis=tuple(range(1, leaf.ndim))) for leaf in jax.tree.leaves(tree)]
    return jnp.stack(flags).all(axis=0)


def _where_finite(finite: Bool[jax.Array, " B"], tree: TreeT) -> TreeT:
    """`tree` with NaN in every number of a candidate that is not finite."""

    def masked(leaf: jax.Array) -> jax.Array:
        return jnp.where(finite.reshape(-1, *[1] * (leaf.ndim - 1)), leaf, jnp.nan)

    return jax.tree.map(masked, tree)


def _require_shapes(phi: jax.Array, state: State, tool: jax.Array, counts: tuple[int, int]) -> None:
    """Raises ParameterError where the arrays do not fit each other or the simulator."""
    candidates = phi.shape[0]
    expected = {
        "phi": (phi.shape, (candidates, counts[0])),
        "state.x": (state.x.shape, (candidates, counts[1], 3)),
        "state.v": (state.v.shape, (candidates, counts[1], 3)),
        "state.C": (state.C.shape, (candidates, counts[1], 3, 3)),
        "state.F": (state.F.shape, (candidates, counts[1], 3, 3)),
        "tool": (tool.shape, (candidates, max(2, tool.shape[1] if tool.ndim == 3 else 0), 3)),
    }
    for name, (given, wanted) in expected.items():
        if tuple(given) != wanted:
            raise ParameterError(f"{name} has shape {tuple(given)}; this simulator takes {wanted}.")
