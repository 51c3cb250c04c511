"""Transitions as arrays, and a model's prediction error for each of them: the one-step Chamfer distance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, NamedTuple, Protocol, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.errors import UsageError
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Transition

Start: TypeAlias = Any
"""A simulator's states of B observed objects, as a JAX pytree."""
Begin = Callable[[Float32[np.ndarray, "B N 3"]], Start]
"""States of observed objects at rest."""
Advance = Callable[[Float[Array, "B P"], Start, Float[Array, "B T C"]], Float[Array, "B N 3"]]
"""Simulator: parameters, states, tool path -> particles after."""


def as_seen(x: Float32[np.ndarray, "B N 3"]) -> Start:
    """The particles themselves as the state, for simulators of observed objects."""
    return x


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """K transitions: particles before and after [m], and the tool path that was measured between them."""

    before: Float32[np.ndarray, "K N 3"]
    tool: Float32[np.ndarray, "K T C"]
    after: Float32[np.ndarray, "K N 3"]

    def __len__(self) -> int:
        return len(self.before)


class ToolPath(Protocol):
    """Conversion of measured tool poses to the path to simulate (`planner.actions.ActionSpace.measured_path`)."""

    def __call__(self, tool: Float[np.ndarray, "M K"]) -> Float32[np.ndarray, "T C"]:
        """The simulated path."""
        ...


def gather(transitions: Sequence[Transition], tool_path: ToolPath) -> Evidence:
    """Transitions as arrays of equal clouds; the tool path is the measured one, else the commanded.

    Raises UsageError where there are no transitions.
    """
    if not transitions:
        raise UsageError("No transitions to learn from; record at least one push.")
    return Evidence(
        before=np.stack([transition.before for transition in transitions]).astype(np.float32),
        tool=np.stack([tool_path(transition.executed.tool) for transition in transitions]),
        after=np.stack([transition.after for transition in transitions]).astype(np.float32),
    )


class _Part(NamedTuple):
    """Transitions that are simulated at once."""

    start: Start
    tool: Float32[np.ndarray, "B T C"]
    after: Float32[np.ndarray, "B N 3"]


@final
@dataclass(frozen=True, kw_only=True)
class ModelScorer:
    """Scores models on evidence, `chunk` transitions at a time: one compiled shape for any number of them.

    `begin` is asked once for the states that evidence begins with, outside of compiled code: what asks the host for
    them would be compiled anew by every process.
    """

    advance: Advance
    chunk: int
    begin: Begin = as_seen

    def losses(self, phi: Float32[np.ndarray, " P"], evidence: Evidence) -> Float32[np.ndarray, " K"]:
        """One-step Chamfer distance [m^2] of every transition; NaN where the simulation left its grid."""
        return np.concatenate([np.asarray(_losses(self.advance, phi, *part)) for part in _parts(self, evidence)])[
            : len(evidence)
        ]

    def slopes(
        self, phi: Float32[np.ndarray, " P"], evidence: Evidence
    ) -> tuple[Float32[np.ndarray, " K"], Float32[np.ndarray, "K P"]]:
        """The losses, and the gradient of each with respect to `phi`."""
        parts = [jax.device_get(_slopes(self.advance, phi, *part)) for part in _parts(self, evidence)]
        losses, gradients = (np.concatenate(pieces)[: len(evidence)] for pieces in zip(*parts, strict=True))
        return losses, gradients

    def shifted_slopes(
        self, phi: Float32[np.ndarray, " P"], shift_m: Float32[np.ndarray, "2"], evidence: Evidence
    ) -> tuple[Float32[np.ndarray, " K"], Float32[np.ndarray, "K P"], Float32[np.ndarray, "K 2"]]:
        """As `slopes`, with the tool shifted by `shift_m` along x and y, and with the gradient by the shift."""
        parts = [jax.device_get(_shifted_slopes(self.advance, phi, shift_m, *part)) for part in _parts(self, evidence)]
        losses, by_phi, by_shift = (np.concatenate(pieces)[: len(evidence)] for pieces in zip(*parts, strict=True))
        return losses, by_phi, by_shift

    def compile(self, phi: Float32[np.ndarray, " P"], example: Evidence) -> None:
        """Compile `slopes` for evidence of these shapes, so that other processes find it; simulates nothing."""
        _slopes.lower(self.advance, phi, *_parts(self, example)[0]).compile()


@lru_cache(maxsize=2)
def _parts(predictor: ModelScorer, evidence: Evidence) -> list[_Part]:
    """Chunks of equal size; the last one is padded by repetitions, whose results are cut off."""
    count, chunk = len(evidence), predictor.chunk
    rows = np.arange(-(-count // chunk) * chunk) % count
    return [
        _Part(predictor.begin(evidence.before[part]), evidence.tool[part], evidence.after[part])
        for part in rows.reshape(-1, chunk)
    ]


def _predicted_losses(
    advance: Advance,
    phi: Float[Array, "K P"],
    start: Start,
    tool: Float[Array, "K T C"],
    after: Float[Array, "K N 3"],
) -> Float[Array, " K"]:
    return chamfer_m2(advance(phi, start, tool), after)


@partial(jax.jit, static_argnums=0)
def _losses(advance: Advance, phi: Array, start: Start, tool: Array, after: Array) -> Array:
    return _predicted_losses(advance, jnp.tile(phi, (len(after), 1)), start, tool, after)


@partial(jax.jit, static_argnums=0)
def _slopes(advance: Advance, phi: Array, start: Start, tool: Array, after: Array) -> tuple[Array, Array]:
    def summed(phis: Array) -> tuple[Array, Array]:
        losses = _predicted_losses(advance, phis, start, tool, after)
        return losses.sum(), losses

    gradients, losses = jax.grad(summed, has_aux=True)(jnp.tile(phi, (len(after), 1)))
    return losses, gradients


@partial(jax.jit, static_argnums=0)
def _shifted_slopes(
    advance: Advance, phi: Array, shift: Array, start: Start, tool: Array, after: Array
) -> tuple[Array, Array, Array]:
    def summed(phis: Array, shifts: Array) -> tuple[Array, Array]:
        there = tool.at[..., :2].add(shifts[:, None])
        losses = _predicted_losses(advance, phis, start, there, after)
        return losses.sum(), losses

    count = len(after)
    each = jnp.tile(phi, (count, 1)), jnp.tile(shift, (count, 1))
    gradients, losses = jax.grad(summed, argnums=(0, 1), has_aux=True)(*each)
    return losses, *gradients
