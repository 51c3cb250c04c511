"""ILD, imitation learning through a differentiable simulator (Chen et al. 2022, "... via differentiable physics").

The policy acts in the simulator, and what it is to match are not the demonstrated actions but the places where the
object went: the slopes of that go through the rollout to the policy (section 3.2, with the Chamfer distance to the
demonstrated states as its loss, equation 4).
"""

from dataclasses import dataclass
from functools import partial
from typing import Final, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from app.core.errors import UsageError
from app.core.geometry.chamfer import chamfer_m2
from app.policy.base import ActionDistribution, PlanningState
from app.policy.learned.base import Chunk, Lessons, NextOnly, Params, Scale, Shown, TrainingSimulator
from app.policy.learned.networks import EncoderMLP, apply_network
from app.policy.learned.sight import PolicyObservation
from app.sim.candidates import are_finite
from app.sim.diagnosis.object_state import ObjectState

_UNIT_M: Final = 0.01
"""A distance from a demonstrated state that counts as 1."""


@final
@dataclass(frozen=True, kw_only=True)
class Imitation(NextOnly):
    """`window` actions in a row are rolled out, from every demonstrated state on.

    `told` weighs how far the moves are from those that were demonstrated: a tool that touches nothing changes nothing,
    so no slope leads it to where it would. `steepest`: the length beyond which the slope of one candidate's own loss in
    its action is shortened, so that one which explodes through a contact leaves the others alone, and what is told is
    heard: of one demonstration of three pushes the ends were 75 mm off where 3.0 was allowed, and 1 mm where 0.3 was.
    """

    width: int = 32
    hidden: int = 256
    depth: int = 2
    window: int = 2
    told: float = 0.2
    steepest: float = 0.3

    def begin(self, key: PRNGKeyArray, seen: PolicyObservation, how: Lessons) -> Params:
        """Initial parameters, as flax draws them. Raises UsageError if there is no simulator to learn in."""
        _world(how)
        params: Params = self._network(how.space.chunk).init(key, seen)["params"]
        return params

    def loss(self, params: Params, key: PRNGKeyArray, shown: Shown, how: Lessons, scale: Scale) -> Float[Array, ""]:
        """Equation 4 over the window, and `told` times the mean squared error of the first moves."""
        del key
        world = _world(how)
        now = PlanningState(world.begin(shown.now.x), shown.now.tool)
        phi = jnp.tile(jnp.array(world.phi), (len(now.x), 1))
        lost = self.told * ((self._moves(params, shown.seen, how) - scale.to(shown.actions)) ** 2).mean()
        for step in range(self.window):
            action = self._projected_action(params, shown.goal, now, how, scale)
            state = world.advance(phi, now.state, how.space.tool_path(action, now.tool))
            state = _finite(state, now.state)
            off = chamfer_m2(state.x, shown.after[:, step]) / _UNIT_M**2
            lost += (shown.counts[:, step] * off).mean() / self.window
            now = PlanningState(state, how.space.after(action, now.tool))
        return lost

    def act(self, params: Params, seen: PolicyObservation, how: Lessons, scale: Scale) -> ActionDistribution:
        """The one action that it knows."""
        moves = self._moves(params, seen, how)
        return scale.back(moves, jnp.zeros_like(moves))

    def _moves(self, params: Params, seen: PolicyObservation, how: Lessons) -> Float[Array, "B T K"]:
        out = apply_network(self._network(how.space.chunk), params, seen)
        return out.reshape(-1, *how.space.chunk)

    def _projected_action(
        self, params: Params, goal: Float[Array, "B M 3"], now: PlanningState, how: Lessons, scale: Scale
    ) -> Float[Array, "B A"]:
        """The projected action; gradients pass the projection unchanged, and are clipped."""
        wanted = how.act_in_frame(goal, now, lambda seen: self.act(params, seen, how, scale)).mean
        here, start = jax.lax.stop_gradient((wanted, now))
        # The loss is a mean over the candidates.
        return _shorten(wanted + (how.space.project(here, start) - here), self.steepest / len(wanted))

    def _network(self, chunk: Chunk) -> EncoderMLP:
        return EncoderMLP(self.width, self.hidden, self.depth, int(np.prod(chunk)))


def _world(how: Lessons) -> TrainingSimulator:
    if how.world is None:
        raise UsageError("Imitation through a simulator needs one; give its lessons a world.")
    return how.world


def _finite(state: ObjectState, before: ObjectState) -> ObjectState:
    """The state, with that before of each candidate whose simulation became non-finite; it has no gradient then."""
    fine = are_finite(*state)
    pairs = zip(state, before, strict=True)
    return type(state)(*(jnp.where(fine.reshape(-1, *[1] * (new.ndim - 1)), new, old) for new, old in pairs))


@partial(jax.custom_vjp, nondiff_argnums=(1,))
def _shorten(actions: Float[Array, "B A"], steepest: float) -> Float[Array, "B A"]:
    """The same, with slopes of each candidate no longer than that, and none where they are no numbers."""
    del steepest
    return actions


def _shortened_forward(actions: Float[Array, "B A"], steepest: float) -> tuple[Float[Array, "B A"], None]:
    del steepest
    return actions, None


def _shortened_backward(steepest: float, _: None, slopes: Float[Array, "B A"]) -> tuple[Float[Array, "B A"]]:
    length = jnp.linalg.norm(slopes, axis=1, keepdims=True)
    shorter = slopes * jnp.minimum(1.0, steepest / jnp.maximum(length, 1e-12))
    return (jnp.where(jnp.isfinite(length), shorter, 0.0),)


_shorten.defvjp(_shortened_forward, _shortened_backward)
LEARNER = Imitation()
