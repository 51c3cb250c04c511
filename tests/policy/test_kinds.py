"""Every way to learn: what is learned of a few demonstrations is done again, in files and rollouts as well."""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import RecordingError, UsageError
from app.jobs.jit_cache import nominal_model
from app.jobs.teaching import lessons, simulator
from app.planner.search.tree import first_action
from app.policy.base import PlanningState
from app.policy.learned import kinds
from app.policy.learned.base import LearnedPolicy, Params
from app.policy.learned.examples import Batch, Examples, scale_of
from app.policy.learned.file import FILE, Origin, load_policy, load_training, save_policy, save_training
from app.policy.learned.kinds.ild import Imitation
from app.policy.learned.train import Progress, TrainingSettings, begin, learn
from app.policy.symmetry import Symmetry
from app.sim.state import State
from app.tasks import load
from tests.programs import program

TASK = load("rope_push")
COUNT = 100
WORLD = simulator(TASK, nominal_model("rope_push"), COUNT)
PHI = jnp.array(WORLD.phi)[None]
HOW = lessons(TASK, WORLD)
COARSE = replace(HOW, symmetry=Symmetry(), views=(replace(HOW.views[0], pixel_m=0.016),))
NEAR_M = {"act": 0.012, "bc": 0.004, "diffusion": 0.02, "ild": 0.005, "transporter": 0.016}
"""Largest error [m] at both ends of each push after a test's few steps of training; a pixel of the views is 16 mm."""


def taught(count: int) -> Examples:
    """Demonstrations of the scripted expert in the simulator: `count` of them, of three pushes each."""
    rows = []
    for seed in range(count):
        x, goal = TASK.particles(TASK.start(seed), COUNT), TASK.goal(seed, COUNT)
        now = PlanningState.at_rest(jnp.asarray(x)[None])
        prepared = TASK.policy.prepare(x, goal)
        for _ in range(3):
            action = program(TASK.actions.project)(first_action(TASK.policy, prepared, now), now)
            state = WORLD.advance(PHI, now.state, program(TASK.actions.tool_path)(action, now.tool))
            rows.append((*map(np.asarray, (now.x[0], goal, now.tool[0], action[0], state.x[0])), seed))
            now = now._replace(state=state)
    return Examples(*(np.stack(column) for column in zip(*rows, strict=True)))


@pytest.fixture(scope="module")
def one() -> Examples:
    return taught(1)


def enough(kind: str) -> TrainingSettings:
    """Settings with steps enough to learn a demonstration of three pushes."""
    steps = {"act": 400, "diffusion": 800, "ild": 250, "transporter": 150}.get(kind, 300)
    return TrainingSettings(
        steps=steps, batch=3, warm_up=20, patience=steps, learning_rate=1e-3 if kind != "bc" else 5e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", kinds.names())
def test_a_single_demonstration_is_done_again(kind: str, one: Examples) -> None:
    learner = Imitation(window=1) if kind == "ild" else kinds.load(kind)
    policy, training = learn(learner, COARSE, one, enough(kind))
    assert training.step == enough(kind).steps
    np.testing.assert_allclose(ends(acting(policy, one)), ends(one.actions), atol=NEAR_M[kind])


@pytest.mark.parametrize("kind", kinds.names())
def test_the_file_of_a_policy_acts_as_it_does_and_no_candidate_heeds_those_beside_it(
    kind: str, one: Examples, tmp_path: Path
) -> None:
    policy = unlearned(kind, one)
    save_policy(tmp_path / FILE, policy, origin_of(kind))
    assert (tmp_path / FILE).stat().st_size < 3e6
    stored, origin = load_policy(tmp_path, task="rope_push", how=COARSE)
    assert origin.kind == kind
    made = acting(policy, one)
    np.testing.assert_allclose(acting(stored, one), made, atol=4e-3)
    # As many each time, so that it is the same program.
    alike = [acting(policy, one.of(np.full(len(one.x), index))) for index in range(len(one.x))]
    for among_equals, among_others in zip(alike, made, strict=True):
        np.testing.assert_allclose(among_equals, np.broadcast_to(among_others, made.shape), atol=1e-4)
    again, _ = load_policy(tmp_path, task="rope_push", how=COARSE)
    assert again == stored
    assert hash(again) == hash(stored)


def test_the_slope_through_frame_and_simulator_is_that_of_the_loss(one: Examples) -> None:
    learner, how = Imitation(told=0.0, steepest=np.inf), HOW
    batch = Batch.of(one, np.array([0]), learner.window)
    shown = batch.observe(how)
    scale = scale_of(how, one, 0)
    params = dict(begin(learner, how, one, TrainingSettings()).params)
    last = dict(params["Dense_0"])
    name = sorted(layer for layer in last if layer.startswith("Dense"))[-1]
    # As the first push was shown, in its frame, a little beside: there the finger moves the rope.
    framed = batch.to_frame(how)
    assert abs(float(how.symmetry.frame(batch.goal, batch.x).angle[0])) > 0.1
    told = scale.to(framed.actions).reshape(-1) + 0.03

    def loss(bias: jax.Array) -> jax.Array:
        changed = last | {name: {"kernel": jnp.zeros_like(last[name]["kernel"]), "bias": bias}}
        return learner.loss(params | {"Dense_0": changed}, jax.random.key(0), shown, how, scale)

    slope = jax.jit(jax.grad(loss))(told)
    way, step = slope / jnp.linalg.norm(slope), 2e-3
    measured = (jax.jit(loss)(told + step * way) - jax.jit(loss)(told - step * way)) / (2 * step)
    assert measured > 0
    np.testing.assert_allclose(measured, jnp.linalg.norm(slope), rtol=0.05)


def test_a_rollout_that_ends_in_no_numbers_counts_as_one_that_moved_nothing(one: Examples) -> None:
    learner, shown = Imitation(told=0.0), Batch.of(one, np.array([0, 1]), Imitation().window)
    scale, seen = scale_of(COARSE, one, 0), shown.observe(COARSE)
    params = begin(learner, COARSE, one, TrainingSettings()).params

    @jax.jit
    @jax.value_and_grad
    def loss(at: Params, shares: jax.Array) -> jax.Array:
        """Loss in a world where the object goes with the tool, by the candidate's share of its path."""

        def advance(phi: jax.Array, state: State, path: jax.Array) -> State:
            went = (path[:, -1, :3] - path[:, 0, :3])[:, None]
            return state._replace(x=state.x + went * shares[:, None, None])

        how = replace(COARSE, world=replace(WORLD, advance=advance))
        return learner.loss(at, jax.random.key(0), seen, how, scale)

    (lost, slopes), (wanted, _) = (loss(params, jnp.array([first, 1.0])) for first in (jnp.inf, 0.0))
    assert jnp.isfinite(wanted)
    np.testing.assert_allclose(lost, wanted, rtol=1e-5)
    steep = np.concatenate([np.ravel(each) for each in jax.tree_util.tree_leaves(slopes)])
    assert np.isfinite(steep).all()
    assert np.abs(steep).max() > 0


def test_a_policy_of_another_task_is_refused_by_name(one: Examples, tmp_path: Path) -> None:
    policy, _ = learn(kinds.load("bc"), HOW, one, TrainingSettings(steps=1, batch=2))
    save_policy(tmp_path / FILE, policy, origin_of("bc"))
    with pytest.raises(UsageError, match="of rope_push, not of bean_sweep"):
        load_policy(tmp_path, task="bean_sweep", how=lessons(load("bean_sweep")))
    broken = replace(policy, params={name: value for name, value in policy.params.items() if name != "Gist_0"})
    save_policy(tmp_path / FILE, broken, origin_of("bc"))
    with pytest.raises(RecordingError, match="no whole policy"):
        load_policy(tmp_path, task="rope_push", how=HOW)
    (tmp_path / FILE).write_bytes(b"no numbers")
    with pytest.raises(RecordingError, match="train it again"):
        load_policy(tmp_path, task="rope_push", how=HOW)


def test_a_training_that_was_broken_off_goes_on_as_if_it_had_not_been(tmp_path: Path) -> None:
    how, shown, whole = HOW, taught(3), TrainingSettings(steps=6, batch=4, check_every=2)
    straight, _ = learn(kinds.load("bc"), how, shown, whole)
    begun = begin(kinds.load("bc"), how, shown, whole)

    def broken(_: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn(kinds.load("bc"), how, shown, whole, begun, broken)
    assert begun.step == 2
    save_training(tmp_path / "half", begun, {"steps": 6})
    stored = load_training(tmp_path / "half", begin(kinds.load("bc"), how, shown, whole), {"steps": 6})
    resumed, _ = learn(kinds.load("bc"), how, shown, whole, stored)
    np.testing.assert_allclose(acting(resumed, shown), acting(straight, shown), atol=1e-5)
    with pytest.raises(UsageError, match="other options"):
        load_training(tmp_path / "half", begun, {"steps": 7})


def unlearned(kind: str, shown: Examples) -> LearnedPolicy:
    """Policy with the parameters at which learning begins."""
    learner = kinds.load(kind)
    params = begin(learner, COARSE, shown, TrainingSettings()).params
    return LearnedPolicy.of(learner, COARSE, params, scale_of(COARSE, shown, 0))


def origin_of(kind: str) -> Origin:
    return Origin(
        task="rope_push", kind=kind, seed=0, steps=1, held_out_loss=0.0, code_version="test", command="dipac train"
    )


def acting(policy: LearnedPolicy, shown: Examples) -> np.ndarray:
    """Actions of the policy in all the situations, as candidates side by side."""
    prepared = policy.prepare(shown.x[0], shown.goal[0])
    now = PlanningState.at_rest(jnp.asarray(shown.x))
    return np.asarray(first_action(policy, prepared, now))


def ends(actions: np.ndarray) -> np.ndarray:
    steps = actions.reshape(len(actions), -1, 2)
    return np.stack([steps[:, 0], steps.sum(1)], axis=1)
