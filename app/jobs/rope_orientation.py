"""Parameters along a rope as it lies: which of its ends is the model's first one is followed from push to push.

Simulators take parameters that are odd along the object (`Effect.odd`) in the order of the rope's nodes. Here they are
turned to that order; while nobody knows which way round the rope lies they are 0, and the even ones act alone.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.geometry.orientation import Orientation
from app.core.messages import Model, Transition
from app.core.types import Centreline, Points
from app.discovery.residuals.steppers import is_flung
from app.jobs import jit_cache
from app.planner.search.tree import Advance
from app.sim.diagnosis.object_state import ObjectState
from app.sim.model.params import odd_values, with_orientation
from app.tasks import load


def oriented_phi(
    model: Model, observed: Points, orientation: Orientation, near: Centreline | None = None
) -> Float32[np.ndarray, " P"]:
    """The parameters of `model` for a simulation from an object `observed` (N, 3) [m].

    Odd parameters have the sign of its nodes' order, or are 0 where that is unknown. `near`: as in `jobs.plan`.
    """
    phi = jit_cache.phi_of(model)
    if not any(odd_values(phi)) or load(model.task).dynamics != "rods":
        return phi
    known = orientation.for_odd_parameters(odd_values(phi))
    return with_orientation(phi, known.sign(_nodes(model.task, observed, near)))


def track_orientation(task: str, orientation: Orientation, transition: Transition, model: Model) -> Orientation:
    """The belief about the rope's ends after `transition`, which is simulated either way round.

    Nothing changes for a model without odd parameters, and for other objects than rods.
    """
    data, phi = load(task), jit_cache.phi_of(model)
    if not any(odd_values(phi)) or data.dynamics != "rods":
        return orientation
    known = orientation.for_odd_parameters(odd_values(phi))
    before = _nodes(task, transition.before, known.line if known.line.size else None)
    path = data.actions.measured_path(transition.executed.tool)
    state = data.initial_state(jnp.asarray(transition.before)[None], jnp.asarray(before))
    simulate = jit_cache.action_simulator(task, len(transition.before), *jit_cache.needs(task, phi))
    predicted = np.asarray(_either(simulate, jnp.asarray(_either_way(phi)), state, jnp.asarray(path)))
    finite = np.isfinite(predicted).all()
    after = _nodes(task, transition.after, predicted.mean(0) if finite else before)
    return known.observe(before, predicted, after)


def _either_way(phi: Float32[np.ndarray, " P"]) -> Float32[np.ndarray, "2 P"]:
    return np.stack([with_orientation(phi, sign) for sign in (1.0, -1.0)])


def _nodes(task: str, x: Points, near: Centreline | None) -> Centreline:
    """Nodes of a rope that is seen at `x`, in the order in which simulations of it begin."""
    begun = load(task).initial_state(jnp.asarray(x)[None], None if near is None else jnp.asarray(near))
    return np.asarray(begun.centreline[0])


@partial(jax.jit, static_argnums=0)
def _either(
    simulate: Advance, phi: Float[Array, "2 P"], state: ObjectState, tool: Float[Array, "T C"]
) -> Float[Array, "2 2 n"]:
    """Nodes after a push of the same rope by two models; NaN where time steps failed."""
    both, tools = jax.tree.map(partial(jnp.repeat, repeats=2, axis=0), state), jnp.repeat(tool[None], 2, axis=0)
    end = simulate(phi, both, tools)
    return jnp.where(is_flung(both.x, end.x, tools[..., :2])[:, None, None], jnp.nan, end.centreline)
