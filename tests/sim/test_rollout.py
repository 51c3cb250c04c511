"""Laws of the operation: candidates are independent, actions chain, NaN is a value."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError
from app.sim.model.catalogue import EFFECTS
from app.sim.mpm.action_kernels import RESIDENT, action_kernels
from app.sim.mpm.candidate_kernels import candidate_kernels
from app.sim.mpm.particle_kernels import particle_kernels
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.runtime.schedule import Launched, ThreadedCandidates, code_of, schedule_for
from app.sim.state import State
from tests.sim.scenes import PARTICLES, SCENE, block, far_tool, phi_with, rope, straight_tool

STEPS = 40
CANDIDATES = 5
SIMULATE = make_rollout(SCENE, particle_count=PARTICLES)

of_threads = pytest.mark.skipif(jax.default_backend() != "cpu", reason="Only the CPU's schedule has threads.")


def problem(count: int = PARTICLES) -> tuple[jax.Array, State, jax.Array]:
    """Five different candidates, pushed by the finger."""
    phi = np.stack([phi_with(stiffness=1e4 * (1 + b), table_friction=0.2 + 0.1 * b) for b in range(CANDIDATES)])
    x = np.stack([rope(count, seed=b) for b in range(CANDIDATES)])
    tools = [straight_tool((0.49 + 0.01 * b, -0.022, 0.005), (0, 0.2 + 0.05 * b, 0), STEPS) for b in range(CANDIDATES)]
    return jnp.asarray(phi), State.at_rest(jnp.asarray(x)), jnp.asarray(np.stack(tools))


@cache
def gradient_of(simulate: Simulate) -> Callable[..., tuple[jax.Array, State, jax.Array]]:
    """Gradient of the sum of squared positions and velocities, with respect to phi, state and tool."""

    def value(*at) -> jax.Array:
        end = simulate(*at)
        return (end.x**2).sum() + (end.v**2).sum()

    return jax.jit(jax.grad(value, argnums=(0, 1, 2)))


def gradients(simulate: Simulate, phi: jax.Array, state: State, tool: jax.Array) -> tuple[jax.Array, State, jax.Array]:
    return gradient_of(simulate)(phi, state, tool)


def assert_same(a: object, b: object) -> None:
    """NaN equal to NaN; bit by bit on a CPU, to rounding on a GPU, whose threads add up in any order."""
    if jax.default_backend() == "cpu":
        jax.tree.map(np.testing.assert_array_equal, a, b)
    else:
        jax.tree.map(assert_close, a, b)


def assert_close(a: jax.Array, b: jax.Array) -> None:
    """NaN equal to NaN, and all else to a thousandth of the largest number: contact amplifies rounding."""
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-3 * float(np.nanmax(np.abs(b))))


def candidate(tree: object, b: int) -> object:
    """One candidate as a batch of one."""
    return jax.tree.map(lambda leaf: leaf[b : b + 1], tree)


def without(tree: object, b: int) -> object:
    """All candidates but one."""
    return jax.tree.map(lambda leaf: np.delete(np.asarray(leaf), b, axis=0), tree)


def test_a_batch_equals_its_candidates_one_by_one():
    together, slopes = SIMULATE(*problem()), gradients(SIMULATE, *problem())
    for b in range(CANDIDATES):
        alone = candidate(problem(), b)
        assert_same(candidate(together, b), SIMULATE(*alone))
        assert_same(candidate(slopes, b), gradients(SIMULATE, *alone))


@of_threads
def test_the_number_of_threads_changes_nothing():
    kernels = candidate_kernels(code_of(SCENE, EFFECTS))
    one, three = (
        make_rollout(
            SCENE,
            particle_count=PARTICLES,
            schedule=ThreadedCandidates(kernels=kernels, threads=threads),
        )
        for threads in (1, 3)
    )
    assert_same(one(*problem()), three(*problem()))
    assert_same(gradients(one, *problem()), gradients(three, *problem()))


def on_a_gpu(multiprocessors: int) -> Launched:
    code = code_of(SCENE, EFFECTS)
    kinds = tuple(action_kernels(code, by_planes=by_planes) for by_planes in (True, False))
    return Launched(substeps=particle_kernels(code), actions=kinds, multiprocessors=multiprocessors, lanes=32)


def test_a_launch_a_substep_as_on_a_gpu_equals_a_launch_an_action():
    launched = make_rollout(SCENE, particle_count=PARTICLES, schedule=on_a_gpu(multiprocessors=0))
    for ours, theirs in zip(launched(*problem()), SIMULATE(*problem()), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-5 * float(np.abs(theirs).max()))
    ours, theirs = (jax.tree.leaves(gradients(simulate, *problem())) for simulate in (launched, SIMULATE))
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-3 * float(np.abs(other).max()))


@pytest.mark.skipif(jax.default_backend() == "cpu", reason="needs a GPU")
@pytest.mark.parametrize("kind", [0, 1])
def test_an_action_in_one_launch_on_a_gpu_equals_a_launch_a_substep(kind: int):
    gpu = schedule_for(jax.default_backend(), SCENE, EFFECTS)
    assert isinstance(gpu, Launched)
    whole = make_rollout(SCENE, particle_count=PARTICLES, schedule=replace(gpu, actions=(gpu.actions[kind],)))
    parts = make_rollout(SCENE, particle_count=PARTICLES, schedule=replace(gpu, actions=()))
    for ours, theirs in zip(whole(*problem()), parts(*problem()), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-5 * float(np.abs(theirs).max()))
    ours, theirs = (jax.tree.leaves(gradients(simulate, *problem())) for simulate in (whole, parts))
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-3 * float(np.abs(other).max()))


@pytest.mark.skipif(jax.default_backend() == "cpu", reason="needs a GPU")
@pytest.mark.parametrize("kind", [0, 1])
@pytest.mark.parametrize("groups", [1, 2])
def test_blocks_that_wait_for_one_another_equal_a_launch_a_substep(kind: int, groups: int):
    """Candidates of several blocks; a grid is computed again by threads of its own (two groups), or by the same."""
    gpu, count = schedule_for(jax.default_backend(), SCENE, EFFECTS), 400
    assert isinstance(gpu, Launched)
    kernels = gpu.actions[kind]
    assert kernels.blocks(count) > 1
    fitting = -(-groups * CANDIDATES * kernels.blocks(count) // RESIDENT)
    launched = replace(gpu, actions=(kernels,), multiprocessors=fitting)
    assert launched.back(CANDIDATES, count) == (kernels, groups)
    whole = make_rollout(SCENE, particle_count=count, schedule=launched)
    parts = make_rollout(SCENE, particle_count=count, schedule=replace(gpu, actions=()))
    for ours, theirs in zip(whole(*problem(count)), parts(*problem(count)), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-5 * float(np.abs(theirs).max()))
    ours, theirs = (jax.tree.leaves(gradients(simulate, *problem(count))) for simulate in (whole, parts))
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-3 * float(np.abs(other).max()))


def test_actions_are_one_launch_where_all_their_threads_fit_on_the_gpu():
    gpu = on_a_gpu(multiprocessors=132)  # An H100.
    by_planes, whole = gpu.actions
    sizes = (16, 300), (16, 1000), (16, 2000), (150, 300), (256, 2000)
    assert [gpu.forth(*size) for size in sizes] == [by_planes, by_planes, whole, whole, None]
    assert [gpu.back(*size) for size in sizes] == [(by_planes, 2), (whole, 2), (whole, 2), (whole, 1), (None, 1)]
    assert on_a_gpu(multiprocessors=0).forth(1, 1) is None


def test_two_chained_actions_equal_one_long_action_in_value_and_gradient():
    def chained(phi: jax.Array, state: State, tool: jax.Array) -> State:
        half = STEPS // 2
        return SIMULATE(phi, SIMULATE(phi, state, tool[:, : half + 1]), tool[:, half:])

    assert_same(jax.jit(chained)(*problem()), SIMULATE(*problem()))
    for ours, whole in zip(
        jax.tree.leaves(gradients(chained, *problem())), jax.tree.leaves(gradients(SIMULATE, *problem())), strict=True
    ):
        tolerance = 1e-5 if jax.default_backend() == "cpu" else 1e-3
        np.testing.assert_allclose(ours, whole, rtol=1e-4, atol=tolerance * float(np.abs(whole).max()))


@pytest.mark.parametrize("where", ["phi", "x", "v", "C", "F", "tool", "infinite x", "outside x"])
def test_a_bad_number_spoils_its_own_candidate_and_no_other(where: str):
    phi, state, tool = problem()
    bad = 2
    changes = {
        "phi": lambda: (phi.at[bad, 0].set(jnp.nan), state, tool),
        "x": lambda: (phi, state._replace(x=state.x.at[bad, 7, 1].set(jnp.nan)), tool),
        "v": lambda: (phi, state._replace(v=state.v.at[bad, 7, 1].set(jnp.nan)), tool),
        "C": lambda: (phi, state._replace(C=state.C.at[bad, 7, 1, 1].set(jnp.nan)), tool),
        "F": lambda: (phi, state._replace(F=state.F.at[bad, 7, 1, 1].set(jnp.nan)), tool),
        "tool": lambda: (phi, state, tool.at[bad, 10].set(jnp.nan)),
        "infinite x": lambda: (phi, state._replace(x=state.x.at[bad, 7, 0].set(jnp.inf)), tool),
        "outside x": lambda: (phi, state._replace(x=state.x.at[bad, 7, 0].set(1e9)), tool),
    }
    arguments = changes[where]()
    end, slopes = SIMULATE(*arguments), gradients(SIMULATE, *arguments)
    assert_same(without(end, bad), without(SIMULATE(phi, state, tool), bad))
    assert_same(without(slopes, bad), without(gradients(SIMULATE, phi, state, tool), bad))
    for leaf in jax.tree.leaves((candidate(end, bad), candidate(slopes, bad))):
        assert np.isnan(leaf).all()


@of_threads
def test_nan_does_not_hide_in_nodes_that_a_particle_reaches_with_weight_zero():
    cell = 2.0**-7  # With powers of two, particles lie exactly between nodes, and the farther ones have no weight.
    scene = replace(SCENE, low=(0.4375, -0.09375, -2 * cell), high=(0.59375, 0.09375, 0.0625), cell_m=cell, dt_s=4e-4)
    simulate = make_rollout(
        scene,
        particle_count=27,
        schedule=ThreadedCandidates(kernels=candidate_kernels(code_of(SCENE, EFFECTS)), threads=1),
    )
    x = block(3, spacing_m=cell, low=(0.5, 0.0, 2 * cell))
    state = State.at_rest(jnp.asarray(np.stack([x, x])))
    phi = jnp.asarray(np.stack([phi_with(), phi_with()]))
    spoiled = state._replace(v=state.v.at[0].set(jnp.nan))
    tool = jnp.asarray(np.stack([far_tool(5)] * 2))
    assert_same(without(simulate(phi, spoiled, tool), 0), without(simulate(phi, state, tool), 0))
    assert_same(without(gradients(simulate, phi, spoiled, tool), 0), without(gradients(simulate, phi, state, tool), 0))


def test_a_bad_tool_path_spoils_its_candidate_even_far_from_the_rope():
    phi, state, tool = problem()
    bad = tool.at[1, :, 2].add(0.5).at[1, 3].set(jnp.nan)
    assert np.isnan(SIMULATE(phi, state, bad).x[1]).all()


def test_a_finger_that_starts_in_the_middle_of_the_rope_has_finite_results_and_gradients():
    phi, state, tool = problem()
    inside = tool.at[..., 1].add(0.022).at[0, :, :2].set(state.x[0, PARTICLES // 2, :2])
    for leaf in jax.tree.leaves((SIMULATE(phi, state, inside), gradients(SIMULATE, phi, state, inside))):
        assert np.isfinite(leaf).all()


def test_a_candidate_that_leaves_the_grid_becomes_nan():
    phi, state, tool = problem()
    thrown = state._replace(v=state.v.at[1].set(jnp.float32([20.0, 0, 0])))
    end = SIMULATE(phi, thrown, tool)
    assert np.isnan(end.x[1]).all()
    assert_same(without(end, 1), without(SIMULATE(phi, state, tool), 1))


def test_arrays_that_do_not_fit_are_refused_by_name():
    phi, state, tool = problem()
    with pytest.raises(ParameterError, match=r"phi has shape \(5, 2\)"):
        SIMULATE(phi[:, :2], state, tool)
    with pytest.raises(ParameterError, match="tool has shape"):
        SIMULATE(phi, state, tool[:3])
    with pytest.raises(ParameterError, match=r"state\.F has shape"):
        SIMULATE(phi, state._replace(F=state.F[:, :4]), tool)
    with pytest.raises(ParameterError, match="particle_count"):
        make_rollout(SCENE, particle_count=0)
