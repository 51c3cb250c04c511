"""Transitions as arrays, and a model's prediction error for each of them: the one-step Chamfer distance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.chamfer import chamfer_m2
from app.core.errors import UsageError
from app.core.messages import Transition

Advance = Callable[[Float[Array, "B P"], Float[Array, "B N 3"], Float[Array, "B T C"]], Float[Array, "B N 3"]]
"""Simulator of an observed object at rest: parameters, particles before, tool path -> particles after."""


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
    """Conversion of measured tool poses to the path to simulate (`app.planner.actions.ActionSpace.measured_path`)."""

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


@final
@dataclass(frozen=True, kw_only=True)
class ModelScorer:
    """Scores models on evidence, `chunk` transitions at a time: one compiled shape for any number of them."""

    advance: Advance
    chunk: int

    def losses(self, phi: Float32[np.ndarray, " P"], evidence: Evidence) -> Float32[np.ndarray, " K"]:
        """One-step Chamfer distance [m^2] of every transition; NaN where the simulation left its grid."""
        return np.concatenate([np.asarray(_losses(self.advance, phi, *part)) for part in self._parts(evidence)])[
            : len(evidence)
        ]

    def slopes(
        self, phi: Float32[np.ndarray, " P"], evidence: Evidence
    ) -> tuple[Float32[np.ndarray, " K"], Float32[np.ndarray, "K P"]]:
        """The losses, and the gradient of each with respect to `phi`."""
        parts = [jax.device_get(_slopes(self.advance, phi, *part)) for part in self._parts(evidence)]
        losses, gradients = (np.concatenate(pieces)[: len(evidence)] for pieces in zip(*parts, strict=True))
        return losses, gradients

    def shifted_slopes(
        self, phi: Float32[np.ndarray, " P"], shift_m: Float32[np.ndarray, "2"], evidence: Evidence
    ) -> tuple[Float32[np.ndarray, " K"], Float32[np.ndarray, "K P"], Float32[np.ndarray, "K 2"]]:
        """As `slopes`, with the tool shifted by `shift_m` along x and y, and with the gradient by the shift."""
        parts = [jax.device_get(_shifted_slopes(self.advance, phi, shift_m, *part)) for part in self._parts(evidence)]
        losses, by_phi, by_shift = (np.concatenate(pieces)[: len(evidence)] for pieces in zip(*parts, strict=True))
        return losses, by_phi, by_shift

    def _parts(self, evidence: Evidence) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Chunks of equal size; the last one is padded by repetitions, whose results are cut off."""
        count = len(evidence)
        rows = np.arange(-(-count // self.chunk) * self.chunk) % count
        return [
            (evidence.before[part], evidence.tool[part], evidence.after[part]) for part in rows.reshape(-1, self.chunk)
        ]


def _predicted_losses(
    advance: Advance,
    phi: Float[Array, "K P"],
    before: Float[Array, "K N 3"],
    tool: Float[Array, "K T C"],
    after: Float[Array, "K N 3"],
) -> Float[Array, " K"]:
    return chamfer_m2(advance(phi, before, tool), after)


@partial(jax.jit, static_argnums=0)
def _losses(advance: Advance, phi: Array, before: Array, tool: Array, after: Array) -> Array:
    return _predicted_losses(advance, jnp.tile(phi, (len(before), 1)), before, tool, after)


@partial(jax.jit, static_argnums=0)
def _slopes(advance: Advance, phi: Array, before: Array, tool: Array, after: Array) -> tuple[Array, Array]:
    def summed(phis: Array) -> tuple[Array, Array]:
        losses = _predicted_losses(advance, phis, before, tool, after)
        return losses.sum(), losses

    gradients, losses = jax.grad(summed, has_aux=True)(jnp.tile(phi, (len(before), 1)))
    return losses, gradients


@partial(jax.jit, static_argnums=0)
def _shifted_slopes(
    advance: Advance, phi: Array, shift: Array, before: Array, tool: Array, after: Array
) -> tuple[Array, Array, Array]:
    def summed(phis: Array, shifts: Array) -> tuple[Array, Array]:
        there = tool.at[..., :2].add(shifts[:, None])
        losses = _predicted_losses(advance, phis, before, there, after)
        return losses.sum(), losses

    count = len(before)
    each = jnp.tile(phi, (count, 1)), jnp.tile(shift, (count, 1))
    gradients, losses = jax.grad(summed, argnums=(0, 1), has_aux=True)(*each)
    return losses, *gradients
