"""The kernels against the plain-JAX reference, forward and backward, through contact with finger and table."""

from collections.abc import Callable, Iterator
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.model.catalogue import discover
from app.sim.model.params import index
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from tests.sim import reference
from tests.sim.scenes import PARTICLES, SCENE, phi_with, rope, straight_tool

STEPS = 50
KNOWN = tuple(discover()[name] for name in ("finger_friction", "viscous_film"))
"""The effects that the reference has."""
SIMULATE = make_rollout(SCENE, particle_count=PARTICLES, effects=KNOWN)


def problem() -> tuple[jax.Array, State, jax.Array]:
    """Two candidates, deformed and moving, that a finger pushes from different sides."""
    rng = np.random.default_rng(3)
    shape = (2, PARTICLES, 3)
    state = State(
        x=np.stack([rope(seed=0), rope(seed=1)]) + np.float32([0, 0, 5e-4]),
        v=rng.normal(0, 0.05, shape).astype(np.float32),
        C=rng.normal(0, 2.0, (*shape, 3)).astype(np.float32),
        F=(np.eye(3) + rng.normal(0, 0.05, (*shape, 3))).astype(np.float32),
    )
    changed = phi_with(film_drag=3.0), phi_with(stiffness=5e4, table_friction=0.8, finger_friction=0.6)
    phi = np.stack(changed)[:, [index(name) for name in reference.PARAMETERS]]
    tool = np.stack(
        [
            straight_tool((0.51, -0.021, 0.004), (0.05, 0.30, 0.0), STEPS),
            straight_tool((0.53, 0.020, 0.006), (0.0, -0.25, 0.02), STEPS),
        ]
    )
    return jax.tree.map(jnp.asarray, (phi, state, tool))


def relative(a: jax.Array, b: jax.Array) -> float:
    """Difference relative to `b`, both as Euclidean norms: single entries of C differ by rounding of large stresses."""
    return float(np.linalg.norm(np.ravel(a - b)) / np.linalg.norm(np.ravel(b)))


def test_fifty_substeps_agree_to_1e_4_in_every_part_of_the_state():
    phi, state, tool = problem()
    ours, theirs = SIMULATE(phi, state, tool), reference.simulate(SCENE, phi, state, tool)
    assert relative(ours.x - state.x, theirs.x - state.x) < 1e-4
    for part in ("v", "C", "F"):
        assert relative(getattr(ours, part), getattr(theirs, part)) < 1e-4, part


def test_the_finger_and_the_table_are_part_of_what_is_compared():
    phi, state, tool = problem()
    away = tool.at[..., 2].add(0.1)
    pushed, free = SIMULATE(phi, state, tool), SIMULATE(phi, state, away)
    assert np.abs(pushed.x - free.x).max() > 2e-3
    lifted = SIMULATE(phi, state._replace(x=state.x.at[..., 2].add(0.02)), away)
    assert np.abs(lifted.v - free.v).max() > 0.05


def weights(smooth: bool) -> State:
    """A weight for every number of the final state, each part at its own scale.

    Random ones let no entry hide behind another; smooth ones do not drown differences in the rounding of float32.
    """
    rng = np.random.default_rng(7)
    scales = State(x=1e3, v=1.0, C=1e-2, F=1.0)
    draw = partial(wave, rng) if smooth else partial(noise, rng)
    return jax.tree.map(lambda part, scale: scale * draw(part.shape), problem()[1], scales)


def noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return rng.normal(size=shape)


def wave(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Varies with candidate and component, and slowly along the rope."""
    along = 1 + 0.5 * np.sin(np.linspace(0, 4, shape[1]))
    return rng.normal(size=(shape[0], 1, *shape[2:])) * along.reshape(1, -1, *[1] * (len(shape) - 2))


def weighted(simulate: Callable[..., State], smooth: bool = False) -> Callable[..., jax.Array]:
    """The weighted sum of the final state."""

    def value(phi: jax.Array, state: State, tool: jax.Array) -> jax.Array:
        end = simulate(phi, state, tool)
        return sum(jnp.sum(part * np.float32(weight)) for part, weight in zip(end, weights(smooth), strict=True))

    return value


def test_gradients_agree_with_those_of_the_reference():
    ours = jax.grad(weighted(SIMULATE), argnums=(0, 1, 2))(*problem())
    theirs = jax.grad(weighted(lambda *at: reference.simulate(SCENE, *at)), argnums=(0, 1, 2))(*problem())
    for column in range(ours[0].shape[1]):
        assert relative(ours[0][:, column], theirs[0][:, column]) < 2e-3, f"phi {column}"
    for part in ("x", "v", "C", "F"):
        assert relative(getattr(ours[1], part), getattr(theirs[1], part)) < 2e-3, part
    assert relative(ours[2], theirs[2]) < 2e-3


STEPS_OF = {"phi": 4e-3, "x": 3e-5, "v": 3e-3, "C": 0.3, "F": 1e-3, "tool": 3e-5}
"""Sizes of the central differences: small beside the widths of contact, large beside float32's rounding."""


@pytest.mark.parametrize("part", STEPS_OF)
def test_gradients_equal_central_differences_through_contact(part: str):
    arguments = dict(zip(STEPS_OF, jax.tree.leaves(problem()), strict=True))
    gradients = jax.tree.leaves(jax.grad(weighted(SIMULATE, smooth=True), argnums=(0, 1, 2))(*problem()))
    gradient = dict(zip(STEPS_OF, gradients, strict=True))[part]

    def end(step: np.ndarray) -> State:
        phi, *state, tool = (arguments | {part: arguments[part] + step}).values()
        return SIMULATE(phi, State(*state), tool)

    for step in directions(part, np.asarray(arguments[part])):
        pairs = zip(end(step), end(-step), weights(smooth=True), strict=True)
        difference = sum((np.float64(a) - np.float64(b)).ravel() @ weight.ravel() for a, b, weight in pairs) / 2
        assert float((gradient * step).sum()) == pytest.approx(difference, rel=0.03)


def directions(part: str, at: np.ndarray) -> Iterator[np.ndarray]:
    """Each parameter of phi alone, the whole tool path along each axis, or smooth fields."""
    rng = np.random.default_rng(11)
    for column in range(at.shape[-1] if part in ("phi", "tool") else 3):
        if part in ("phi", "tool"):
            step = np.zeros(at.shape)
            step[..., column] = np.abs(at[..., column]) + 1.0 if part == "phi" else 1.0
        else:
            step = wave(rng, at.shape)
        yield np.float32(STEPS_OF[part] * step)
