"""A whole action on ropes as rods, as one differentiable JAX operation."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from app.core.errors import ParameterError
from app.sim.candidates import are_finite, as_float32, where_finite
from app.sim.effects.base import Effect
from app.sim.rods.domain import is_in_domain
from app.sim.rods.effect import RodContext, RodProperties, RodSetting
from app.sim.rods.equilibrium import balance_bristles
from app.sim.rods.kernels import FIELDS
from app.sim.rods.laws import changed_properties, law_numbers, law_source, require_known, wall_numbers
from app.sim.rods.operations import RodOperations, make_rod_operations
from app.sim.rods.scene import Numbers, RodScene, numbers_of, smoothing_of
from app.sim.rods.state import RodState

ResultT = TypeVar("ResultT", covariant=True)

_SPRINGBACK = 6
"""Row of the springback in `OwnTraits` of rod.h."""


@final
class RodPhysics(NamedTuple):
    """Unknowns of ropes of B candidates, their table and finger; a JAX pytree."""

    rigidity: Float[jax.Array, " B"]
    """Bending rigidity E I [N m^2]."""
    table_friction: Float[jax.Array, " B"]
    finger_friction: Float[jax.Array, " B"]
    viscosity: Float[jax.Array, " B"]
    """Viscosity in bending: moment per rate of curvature [N m^2 s]."""
    yield_curvature: Float[jax.Array, " B"]
    """Elastic curvature [1/m] beyond which the rope keeps its bend."""
    permanent_set: Float[jax.Array, " B"]
    """Share of its bends that lasts without load: 1 if it is free of stress as it is seen, 0 if it were straight."""
    rest_curvature: Float[jax.Array, " B"]
    """Curvature of the unloaded rope [1/m], besides."""
    climb: Float[jax.Array, " B"]
    """Speed with which the rope slips up and down the finger, as a share of the finger's own: it hops as it slides."""
    press: Float[jax.Array, " B"]
    """Share of the finger's downward push, by its round tip, that the table bears."""
    margin: Float[jax.Array, " B"]
    """Contact margin: finger and rope meet this much before their radii do [m]."""
    creep: Float[jax.Array, " B"]
    """Creep of sticking friction: the speed [m/s] at which it would bear half of the sliding friction."""
    mass: Float[jax.Array, " B"]
    """Mass of the rope [kg]."""
    finger_half_width: Float[jax.Array, " B"]
    """Half width of a flat finger's core [m]; unused if the scene's finger is round."""
    finger_yaw: Float[jax.Array, " B"]
    """Angle from the x axis to that core [rad]."""

    @property
    def finger_half_m(self) -> Float[jax.Array, "B 2"]:
        """Vector from the middle of the finger's core to an end of it [m]."""
        along = jnp.stack([jnp.cos(self.finger_yaw), jnp.sin(self.finger_yaw)], axis=-1)
        return self.finger_half_width[:, None] * along

    @classmethod
    def nominal(cls, scene: RodScene, candidates: int) -> "RodPhysics":
        """A limp rope of 16 mm, scaled to the scene's radius."""
        values = scene.nominal_physics()
        return cls(**{name: jnp.full(candidates, value, jnp.float32) for name, value in values.items()})


class OfRods(Protocol[ResultT]):
    """A simulation of B ropes, each with its own physics, state and finger path."""

    def __call__(
        self,
        physics: RodPhysics,
        state: RodState,
        tool: Float[jax.Array, "B T 3"],
        phi: Float[jax.Array, "B P"] | None = None,
        setting: RodSetting | None = None,
    ) -> ResultT:
        """T - 1 time steps with the finger's tip at `tool[:, s]` [m] at their boundaries.

        `phi`: the parameters of the simulator's effects, one effect after the other; None: all at their null values.
        `setting`: more that effects depend on; None: unknown.
        """
        ...


@final
class RodHistory(NamedTuple):
    """B ropes through an action of T - 1 time steps; a JAX pytree. Nothing in it is masked."""

    nodes: Float[jax.Array, "B T 8 n"]
    """The rows of `RodState.nodes` at the boundaries of all time steps."""
    finger: Float[jax.Array, "B T 4"]
    """Finger in kernels: x, y, distance from the centreline at contact [m] (0: above the rope), sine from above."""
    fields: Float[jax.Array, "B 3 n"]
    """Mass [kg], bending stiffness [N m] and rest angle [rad] of each node, with what effects make of them."""
    springback: Float[jax.Array, " B"]
    """Share of bends that does not last."""


class SimulateRod(OfRods[RodState], Protocol):
    """x' = f(x, u; phi): the last state. Differentiable once, in reverse mode, but by the setting.

    A candidate with a non-finite input, or that begins or has its finger out of the domain (`domain.is_in_domain`),
    becomes NaN throughout; the others are not touched.
    """

    def __call__(
        self,
        physics: RodPhysics,
        state: RodState,
        tool: Float[jax.Array, "B T 3"],
        phi: Float[jax.Array, "B P"] | None = None,
        setting: RodSetting | None = None,
        spans: Int[jax.Array, "B 2"] | None = None,
    ) -> RodState:
        """As `OfRods`, of each candidate from one of its time steps to before another, where they are given as `spans`.

        Candidates that are simulated together make the steps that one of them makes. With spans it is not
        differentiable.
        """
        ...


TraceRod: TypeAlias = OfRods[RodHistory]
"""Rollout that returns every state. Not differentiable; 8 n T numbers a candidate, for sixteen at least on a CPU."""


def make_rod_rollout(scene: RodScene, effects: tuple[Effect, ...] = ()) -> SimulateRod:
    """The simulator of one scene with these effects, for use inside and outside of `jax.jit`. Make it once and keep it.

    Raises ParameterError for an effect that does not act on rods.
    """
    operations = _operations(scene, effects)

    @jax.custom_vjp
    def rollout(start: jax.Array, fields: jax.Array, traits: jax.Array, tool: jax.Array) -> jax.Array:
        return operations.forward(start, fields, traits, tool)

    def rollout_forward(*given: jax.Array) -> tuple[jax.Array, Any]:
        end, kept = operations.kept_forward(*given)
        return end, (kept, *given)

    def rollout_backward(residuals: Any, end_bar: jax.Array) -> tuple[jax.Array, ...]:
        kept, *given = residuals
        return operations.backward(kept, *given, end_bar)

    rollout.defvjp(rollout_forward, rollout_backward)

    def simulate(
        physics: RodPhysics,
        state: RodState,
        tool: Float[jax.Array, "B T 3"],
        phi: Float[jax.Array, "B P"] | None = None,
        setting: RodSetting | None = None,
        spans: Int[jax.Array, "B 2"] | None = None,
    ) -> RodState:
        inputs = _inputs(scene, effects, physics, state, tool, phi, setting)
        end = rollout(*inputs) if spans is None else operations.forward(*inputs, spans)
        sound = are_finite(end, physics, state, tool, () if phi is None else phi)
        sound &= is_in_domain(scene, *jax.lax.stop_gradient((state.nodes, tool)))
        return jax.tree.map(as_float32, state)._replace(nodes=where_finite(sound, end))

    return jax.jit(simulate)


def make_rod_trace(scene: RodScene, effects: tuple[Effect, ...] = ()) -> TraceRod:
    """The simulator that shows every state of an action, by the kernels of `make_rod_rollout`; raises as that."""
    operations = _operations(scene, effects)

    def trace(
        physics: RodPhysics,
        state: RodState,
        tool: Float[jax.Array, "B T 3"],
        phi: Float[jax.Array, "B P"] | None = None,
        setting: RodSetting | None = None,
    ) -> RodHistory:
        inputs = _inputs(scene, effects, physics, state, tool, phi, setting)
        springback = inputs[2][:, _SPRINGBACK]
        return RodHistory(operations.states(*inputs), finger=inputs[3], fields=inputs[1], springback=springback)

    return jax.jit(trace)


def rod_numbers(scene: RodScene) -> Numbers:
    """The constants of the time steps of a scene's simulator."""
    return numbers_of(scene, smoothing_of(scene, *_stiffest_joint(scene)))


def _stiffest_joint(scene: RodScene) -> tuple[float, float]:
    """Stiffness [N m] and damping [N m s] of a node's bending, at most."""
    return scene.max_rigidity_n_m2 / scene.rest_m, scene.max_viscosity_n_m2_s / scene.rest_m


def _operations(scene: RodScene, effects: tuple[Effect, ...]) -> RodOperations:
    require_known(effects)
    laws = law_source(effects, len(scene.walls), flat=scene.finger_half_width_m > 0)
    return make_rod_operations(scene, *_stiffest_joint(scene), laws)


def complete(
    scene: RodScene,
    effects: Sequence[Effect],
    candidates: int,
    phi: Float[jax.Array, "B P"] | None,
    setting: RodSetting | None,
) -> tuple[Float[jax.Array, "B P"], RodSetting]:
    """The given parameters and setting, or by default effects at their nulls and an unknown setting."""
    null = np.array([spec.nominal for effect in effects for spec in effect.parameters], np.float32)
    own = jnp.tile(null, (candidates, 1)) if phi is None else phi
    return own, RodSetting.unknown(candidates, scene.nodes) if setting is None else setting


def _inputs(
    scene: RodScene,
    effects: tuple[Effect, ...],
    physics: RodPhysics,
    state: RodState,
    tool: Float[jax.Array, "B T 3"],
    phi: Float[jax.Array, "B P"] | None,
    setting: RodSetting | None,
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Arguments of the kernels: start, fields, traits, tool."""
    if state.nodes.shape[2] != scene.nodes:  # The kernels take their number from the state, and the matrix has it.
        given = state.nodes.shape[2]
        raise ParameterError(f"The rod has {given} nodes and its scene {scene.nodes}; make both with one spacing_m.")
    own, known = complete(scene, effects, len(tool), phi, setting)
    physics, state, tool, own, known = jax.tree.map(as_float32, (physics, state, tool, own, known))
    context = RodContext(scene=scene, setting=jax.tree.map(jax.lax.stop_gradient, known))
    properties = changed_properties(effects, _properties(scene, physics), own, context)
    walls = wall_numbers(scene.walls, properties.finger_friction / physics.finger_friction)
    numbers = [_traits(scene, physics, properties), *law_numbers(effects, own, context), *walls]
    traits = jnp.concatenate(numbers, axis=1)
    start = balance_bristles(scene, state.nodes, properties, numbers_of(scene, 0.0).table)
    return start, _fields(scene, properties), traits, _fingers(scene, physics, tool)


def _properties(scene: RodScene, physics: RodPhysics) -> RodProperties:
    """The same along the rope, but for its ends' mass."""
    share = jnp.asarray(scene.masses() / scene.mass_kg, jnp.float32)
    ones = jnp.ones(scene.nodes)
    return RodProperties(
        mass=physics.mass[:, None] * share,
        rigidity=physics.rigidity[:, None] * ones,
        rest_curvature=physics.rest_curvature[:, None] * ones,
        table_friction=physics.table_friction,
        finger_friction=physics.finger_friction,
        viscosity=physics.viscosity,
        yield_curvature=physics.yield_curvature,
        permanent_set=physics.permanent_set,
    )


def _fields(scene: RodScene, properties: RodProperties) -> Float[jax.Array, "B 3 n"]:
    """Mass [kg], bending stiffness [N m] and rest angle [rad] of each node."""
    rows = [properties.mass, properties.rigidity / scene.rest_m, properties.rest_curvature * scene.rest_m]
    assert len(rows) == FIELDS
    return jnp.stack(rows, axis=1)


def _traits(scene: RodScene, physics: RodPhysics, properties: RodProperties) -> Float[jax.Array, "B _"]:
    """Parameters in the order of `OwnTraits` and `CoreTraits` in rod.h."""
    half = physics.finger_half_m.T
    return jnp.stack(
        [
            properties.table_friction,
            properties.finger_friction,
            properties.viscosity / scene.rest_m,
            properties.yield_curvature * scene.rest_m,
            physics.climb,
            physics.creep,
            1 - properties.permanent_set,
            *(half if scene.finger_half_width_m > 0 else ()),
        ],
        axis=1,
    )


def _fingers(scene: RodScene, physics: RodPhysics, tool: Float[jax.Array, "B T 3"]) -> Float[jax.Array, "B T 4"]:
    """Place, distance from the centreline at contact, and sine of the angle of contact from above.

    A round tip whose middle is above the rope's meets it at a smaller distance, and presses it down.
    """
    meets = scene.finger_radius_m + scene.radius_m
    above = jnp.clip(tool[..., 2] + scene.finger_radius_m - scene.radius_m, 0.0, None)
    down = above < meets
    reach = jnp.sqrt(jnp.where(down, meets**2 - above**2, 1.0)) + physics.margin[:, None]
    sine = physics.press[:, None] * jnp.where(down, above / meets, 0.0)
    return jnp.stack([tool[..., 0], tool[..., 1], jnp.where(down, reach, 0.0), jnp.minimum(sine, 0.9)], axis=-1)
