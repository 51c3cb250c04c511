"""Every way to learn fits every task; examples are shown in frames, and with the goals that what was done led to."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import UsageError
from app.jobs.jit_cache import nominal_model
from app.jobs.teaching import lessons, simulator
from app.planner.actions.actions import Pushes
from app.planner.actions.sweep_actions import Sweeps
from app.policy.base import PlanningState
from app.policy.learned import kinds
from app.policy.learned.base import LearnedPolicy, Lessons, Scale
from app.policy.learned.examples import Batch, Examples
from app.policy.learned.kinds.act import Act
from app.policy.learned.train import TrainingSettings, begin
from app.policy.symmetry import Isometry
from app.tasks import load, names

COUNT = 60
STROKES = [name for name in names() if isinstance(load(name).actions, Pushes | Sweeps)]


def examples_of(name: str, episodes: int = 2, actions: int = 2) -> Examples:
    """Random actions that leave everything where it is."""
    task, rng, rows = load(name), np.random.default_rng(0), []
    for seed in range(episodes):
        x, goal = (np.float32(each(seed, COUNT)) for each in (_start(name), task.goal))
        tool = np.asarray(PlanningState.at_rest(jnp.asarray(x)[None]).tool[0])
        drawn = task.actions.sample(rng, x, tool.astype(np.float64), actions)
        rows += [(x, goal, tool, action, x, seed) for action in drawn]
    return Examples(*(np.stack(column) for column in zip(*rows, strict=True)))


def _start(name: str):
    task = load(name)
    return lambda seed, count: task.particles(task.start(seed), count)


PAIRS = [
    pytest.param(name, kind, marks=[] if name == "rope_push" or kind == "bc" else pytest.mark.slow)
    for name in names()
    for kind in kinds.names()
]
"""Every kind in one task and one kind in every task are quick enough; the rest is for `make test-slow`."""


@pytest.mark.parametrize(("name", "kind"), PAIRS)
def test_every_kind_can_be_taught_and_acts_in_every_task_or_says_why_not(name: str, kind: str) -> None:
    task, learner, shown = load(name), kinds.load(kind), examples_of(name)
    how = lessons(task, simulator(task, nominal_model(name), COUNT))
    scale = Scale(*np.ones((2, *task.actions.chunk), np.float32))
    batch = Batch.of(shown, np.array([0, 3]), learner.window).to_frame(how)

    def whole(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        seen = batch.observe(how)
        params = learner.begin(key, seen.seen, how)
        policy = LearnedPolicy(learner=learner, how=how, params={}, scale=scale, digest="")
        prepared = policy.prepare(shown.x[0], shown.goal[0])._replace(params=params)
        slopes = jax.grad(partial(learner.loss, key=key, shown=seen, how=how, scale=scale))(params)
        return jax.tree_util.tree_leaves(slopes)[0], policy.act(prepared, seen.now).mean

    if kind == "transporter" and name not in STROKES:
        with pytest.raises(UsageError, match="choose another --policy"):
            jax.eval_shape(whole, jax.random.key(0))
        return
    _, action = jax.eval_shape(whole, jax.random.key(0))
    assert action.shape == (2, task.actions.size)


@pytest.mark.parametrize("name", names())
def test_a_frame_is_where_what_is_moved_by_a_symmetry_looks_the_same(name: str) -> None:
    task, count = load(name), 6
    symmetry = task.symmetry
    x, goal = (np.tile(each[None], (count, 1, 1)) for each in (_start(name)(3, COUNT), task.goal(3, COUNT)))
    rng = np.random.default_rng(1)
    turns = Isometry(
        jnp.ones(count), jnp.asarray(rng.uniform(-3, 3, count), jnp.float32), jnp.asarray(rng.normal(size=(count, 2)))
    )
    by = turns if symmetry.everywhere else _about(symmetry.about_m, turns) if symmetry.turns else None
    if by is None:
        framed = symmetry.frame(jnp.asarray(goal), jnp.asarray(x)).places(jnp.asarray(x))
        np.testing.assert_array_equal(framed, x)
        return
    here = symmetry.frame(jnp.asarray(goal), jnp.asarray(x))
    goals, objects = by.places(jnp.asarray(goal)), by.places(jnp.asarray(x))
    there = symmetry.frame(goals, objects)
    found, wanted = np.asarray(there.places(objects)), np.asarray(here.places(jnp.asarray(x)))
    about = np.array(symmetry.about_m)
    other = np.concatenate([2 * about - wanted[..., :2], wanted[..., 2:]], axis=-1)
    either = np.minimum(*(np.abs(found - each).max((1, 2)) for each in (wanted, other)))
    np.testing.assert_allclose(either, 0.0, atol=1e-4)


def _about(about_m: tuple[float, float], turns: Isometry) -> Isometry:
    about = jnp.tile(jnp.array(about_m), (len(turns.angle), 1))
    still = turns._replace(shift=jnp.zeros_like(turns.shift))
    return still._replace(shift=about - still.directions(about))


def test_what_is_undone_is_as_before() -> None:
    rng = np.random.default_rng(2)
    side, angle, shift = np.sign(rng.normal(size=5)), rng.uniform(-3, 3, 5), rng.normal(size=(5, 2))
    by = Isometry(*(jnp.asarray(each, jnp.float32) for each in (side, angle, shift)))
    x = jnp.asarray(rng.normal(size=(5, 7, 3)), jnp.float32)
    np.testing.assert_allclose(by.inverse.places(by.places(x)), x, atol=1e-5)
    np.testing.assert_allclose(by.inverse.after(by).places(x), x, atol=1e-5)
    np.testing.assert_allclose(by.after(by).places(x), by.places(by.places(x)), atol=1e-5)


def test_what_brought_the_object_nowhere_teaches_where_it_led_and_the_rest_its_goal_too() -> None:
    shown, rng = examples_of("rope_push", episodes=2, actions=3), np.random.default_rng(3)
    nearer = shown._replace(after=np.where(np.arange(6)[:, None, None] % 3 == 0, shown.goal, shown.x))
    np.testing.assert_array_equal(nearer.chances(0.25), [0.25, 1.0, 1.0, 0.25, 1.0, 1.0])
    own, last = nearer.goals(np.arange(6), np.zeros(6), rng)
    np.testing.assert_array_equal(own, nearer.goal)
    np.testing.assert_array_equal(last, [2, 2, 2, 5, 5, 5])
    instead, reached = nearer.goals(np.arange(6), np.ones(6), rng)
    np.testing.assert_array_equal(instead, nearer.after[reached])
    for index in (1, 2, 4, 5):  # After each of these and all later ones of its demonstration the rope is where it was.
        np.testing.assert_array_equal(instead[index], nearer.x[index])
    for index in (0, 3):
        assert any(np.array_equal(instead[index], nearer.after[later]) for later in range(index, index + 3))


def test_nothing_is_asked_of_what_followed_where_the_goal_in_hindsight_was_reached() -> None:
    shown, chosen = examples_of("rope_push", episodes=2, actions=3), np.arange(6)
    numbered = shown._replace(after=np.arange(6, dtype=np.float32)[:, None, None] + np.zeros_like(shown.x))
    drawn = Batch.draw(numbered, chosen, np.ones(6), 3, np.random.default_rng(4))
    reached = np.asarray(drawn.goal[:, 0, 0])
    asked = np.asarray(drawn.counts)
    followed = np.arange(6)[:, None] + np.arange(3)
    np.testing.assert_array_equal(asked, (followed <= reached[:, None]) * (followed // 3 == chosen[:, None] // 3))
    assert (reached == chosen).any()
    assert (reached > chosen).any()


def test_where_the_tool_was_left_tells_nothing_where_actions_begin_anywhere() -> None:
    for name, tells in (("rope_push", False), ("cloth_hang", True)):
        how, shown = lessons(load(name)), examples_of(name, episodes=1, actions=1)
        now = PlanningState.at_rest(jnp.asarray(shown.x))
        elsewhere = now._replace(tool=now.tool + jnp.array([0.1, 0.0, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
        here, there = (how.observation(jnp.asarray(shown.goal), each).tool for each in (now, elsewhere))
        assert (np.abs(np.asarray(there - here)).max() > 0.01) == tells


def coarse(how: Lessons) -> Lessons:
    """The same, seen in pictures of a sixteenth of the pixels."""
    return replace(how, views=tuple(replace(view, pixel_m=4 * view.pixel_m) for view in how.views))


def test_what_was_meant_for_now_at_earlier_decisions_has_a_say_and_the_oldest_the_most() -> None:
    task, learner = load("pour_water"), Act(eyes=8, width=16, depth=1, window=4)
    how, shown = coarse(lessons(task)), examples_of("pour_water", episodes=3, actions=1)
    scale = Scale(*np.ones((2, *task.actions.chunk), np.float32))
    policy = LearnedPolicy.of(learner, how, begin(learner, how, shown, TrainingSettings()).params, scale)

    @partial(jax.jit, static_argnums=0)
    def told(policy, prepared, now):
        acted = policy.act(prepared, now)
        return acted.mean[0], acted.later[0], policy.first(prepared, now).mean[0]

    meant = []
    for x, goal, tool in zip(shown.x, shown.goal, np.float64(shown.tool), strict=True):
        now = PlanningState.at_rest(jnp.asarray(x)[None], tool)
        mean, later, found = told(policy, policy.prepare(x, goal), now)
        meant = [np.stack([mean, *later]), *meant]
        # Made so many decisions ago, it says of now what it said of so many actions later.
        said = np.stack([chunk[ago] for ago, chunk in enumerate(meant)])
        weights = np.exp(-0.01 * np.arange(len(said)))[::-1]
        wanted = (weights[:, None] * said).sum(0) / weights.sum()
        np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5)
        policy = policy.after(x, goal, tool)
    assert len(policy.meant) == 3
    assert len(policy.after(x, goal, tool).meant) == 3
    assert np.abs(said - said[0]).max() > 0.01


def test_nothing_is_remembered_where_chunks_do_not_overlap() -> None:
    for name, kind in (("rope_push", "act"), ("pour_water", "bc")):
        how, shown = lessons(load(name)), examples_of(name, episodes=1, actions=1)
        policy = LearnedPolicy(
            learner=kinds.load(kind), how=how, params={}, scale=Scale(*np.ones((2, 1, 1))), digest=""
        )
        assert policy.after(shown.x[0], shown.goal[0], None) is policy


@pytest.mark.parametrize("name", ["rope_push", "bean_sweep"])
def test_a_policy_does_alike_what_is_turned_on_the_table(name: str) -> None:
    task, learner = load(name), kinds.load("bc")
    how, shown = lessons(task), examples_of(name, episodes=1, actions=1)
    params = begin(learner, how, shown, TrainingSettings()).params
    scale = Scale(np.zeros(task.actions.chunk, np.float32), np.full(task.actions.chunk, 0.01, np.float32))
    policy = LearnedPolicy.of(learner, how, params, scale)
    # As far as it lies along its frame: a principal axis has no head, and may be taken the other way round elsewhere.
    turned = how.symmetry.frame(jnp.asarray(shown.goal), jnp.asarray(shown.x))
    by = _about(task.symmetry.about_m, turned)
    here = PlanningState.at_rest(jnp.asarray(shown.x))
    there = PlanningState(here.state._replace(x=by.places(here.x)), by.poses(here.tool))
    goal = np.asarray(by.places(jnp.asarray(shown.goal)))[0]
    act = jax.jit(policy.act)
    wanted = task.actions.transform(act(policy.prepare(shown.x[0], shown.goal[0]), here).mean, by)
    found = act(policy.prepare(np.asarray(there.x[0]), goal), there).mean
    assert abs(float(turned.angle[0])) > 0.1
    np.testing.assert_allclose(found, wanted, atol=2e-3)
