"""Gradients of pushed ropes against central differences: `python -m bench.rod_gradients`.

Random actions of `rope_push` that move the rope, as rods. The cost is the planner's progress, the Chamfer distance of
300 particles to a goal; its slope is taken along a random change of the action, and with each parameter as a share of
it. Differences are taken with several steps: a cost with contact is rough on small scales, and in single precision
noisy on smaller ones, so that of a push the step counts that agrees best. Where no two steps agree to a fifth there
is no slope to compare with; such pushes are counted as rough.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Float64
from rich.console import Console
from rich.table import Table

from app.core.geometry.chamfer import chamfer_m2
from app.policy.base import PARKED_POSE
from app.sim.rods.rollout import RodPhysics
from app.sim.rods.state import RodState
from app.tasks.elements.rods import CONTACT, NOMINAL
from bench.rods import SCENE, SIMULATE, TASK, physics

COUNT: Final = 160
PARTICLES: Final = 300
MOVED_M: Final = 1e-3
PARAMETERS: Final = ("rigidity", "table_friction", "finger_friction", "mass", "viscosity")
SHARES: Final = (0.02, 0.006, 0.002)
"""Steps of a parameter, as shares of it."""
PARTS: Final = (0.02, 0.006, 0.002)
"""Steps of an action, as shares of its scale: 2 cm of where it starts, and the like."""
NEAR, FAR, ROUGH = 0.10, 3.0, 0.2
_MM2: Final = 1e6


class Slopes(NamedTuple):
    """Slopes by the adjoint (P,), and by differences (S, P) with steps of several sizes [mm^2]."""

    adjoint: Float64[np.ndarray, " P"]
    differences: Float64[np.ndarray, "S P"]

    def verdict(self) -> tuple[str, ...]:
        """Pushes with a slope, rough ones, shares within a tenth, within a factor of three, and the worst ratio."""
        apart = np.abs(np.diff(self.differences, axis=0)) / np.abs(self.differences).max(0)
        smooth = (apart < ROUGH).any(0)
        off = np.abs(self.adjoint - self.differences) / np.abs(self.differences)
        best = np.take_along_axis(self.differences, off.argmin(0)[None], 0)[0][smooth]
        ratio = self.adjoint[smooth] / best
        factor = np.where(ratio > 0, np.maximum(ratio, 1 / np.where(ratio > 0, ratio, 1)), np.inf)
        return (
            f"{smooth.sum()}",
            f"{(~smooth).sum()}",
            f"{100 * (off.min(0)[smooth] <= NEAR).mean():.0f} %",
            f"{(factor > FAR).sum()}",
            f"{factor.max():.3g}",
        )


class PushCases(NamedTuple):
    """Ropes at rest, actions that move them, and goals."""

    physics: RodPhysics
    state: RodState
    actions: Float[jax.Array, "P A"]
    goal: Float[jax.Array, "P M 3"]


def paths(actions: jax.Array) -> jax.Array:
    """Tool paths of the finger [m]."""
    return TASK.actions.tool_path(actions, jnp.tile(jnp.asarray(PARKED_POSE, jnp.float32), (len(actions), 1)))


def costs(physics: RodPhysics, state: RodState, actions: jax.Array, goal: jax.Array) -> jax.Array:
    """Chamfer distance to the goal after each push [mm^2]."""
    path = paths(actions)
    return _MM2 * jax.vmap(chamfer_m2)(SIMULATE(physics, state, path).x, goal)


def push_cases(seed: int) -> PushCases:
    """Random actions, `COUNT` less those that move the rope by less than a millimetre in the mean."""
    rng = np.random.default_rng(seed)
    x = np.stack([TASK.particles(TASK.start(number), PARTICLES) for number in range(COUNT)])
    goal = np.stack([TASK.goal(number, PARTICLES) for number in range(COUNT)])
    actions = np.concatenate([TASK.actions.sample(rng, each, PARKED_POSE, 1) for each in x])
    given = physics(CONTACT | {name: NOMINAL[name] for name in ("table_friction", "finger_friction")}, COUNT)
    state = RodState.at_rest(jnp.asarray(x), SCENE.nodes, SCENE.rest_m, SCENE.radius_m)
    end = np.asarray(SIMULATE(given, state, paths(jnp.asarray(actions))).x)
    moved = np.linalg.norm(end - x, axis=2).mean(1) > MOVED_M
    return jax.tree.map(partial(_of, moved), PushCases(given, state, jnp.asarray(actions), jnp.asarray(goal)))


def _of(which: Bool[np.ndarray, " P"], values: jax.Array) -> jax.Array:
    return values[which]


def slopes(seed: int) -> Iterator[tuple[str, Slopes]]:
    """Slopes along a random change of the action, and with each parameter."""
    given, state, actions, goal = push_cases(seed)
    way = np.random.default_rng(seed).standard_normal(actions.shape).astype(np.float32) * TASK.actions.scale()

    @jax.jit
    def value(physics: RodPhysics, actions: jax.Array) -> jax.Array:
        return costs(physics, state, actions, goal)

    def total(physics: RodPhysics, actions: jax.Array) -> jax.Array:
        return value(physics, actions).sum()

    of_physics, of_actions = jax.jit(jax.grad(total, (0, 1)))(given, actions)

    def differences(steps: tuple[float, ...], change: Callable[[float], tuple[RodPhysics, jax.Array]]) -> np.ndarray:
        ends = [[np.asarray(value(*change(sign * step)), np.float64) for sign in (1, -1)] for step in steps]
        return np.stack([(ahead - behind) / (2 * step) for (ahead, behind), step in zip(ends, steps, strict=True)])

    along = np.asarray((of_actions * way).sum(1), np.float64)
    yield "action", Slopes(along, differences(PARTS, lambda step: (given, actions + step * way)))
    for name in PARAMETERS:
        number = getattr(given, name)

        def changed(step: float, name: str = name, number: jax.Array = number) -> tuple[RodPhysics, jax.Array]:
            return given._replace(**{name: number * (1 + step)}), actions

        adjoint = np.asarray(getattr(of_physics, name) * number, np.float64)
        yield name, Slopes(adjoint, differences(SHARES, changed))


def main() -> None:
    """Print the table."""
    head = ("slope along", "pushes", "rough", "within 10 %", "beyond a factor of 3", "largest factor")
    table = Table(*head)
    for name, found in slopes(0):
        table.add_row(name, *found.verdict())
    Console().print(table)


if __name__ == "__main__":
    main()
