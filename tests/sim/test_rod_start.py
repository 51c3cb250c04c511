"""Centreline of a seen rope from unordered points, and the errors where it is ambiguous."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.config import Workspace
from app.core.errors import PerceptionError
from app.sim.rods import state
from app.sim.rods.geometry.centreline import trace
from app.sim.rods.geometry.polyline import distance, of_equal_steps
from app.sim.rods.geometry.rope_cloud import RopeShape
from app.sim.rods.geometry.verdict import assess, crossing
from app.sim.rods.state import RodStart, RodState
from app.tasks.elements.curves import fill_tube, random_curve

ROPE = RopeShape(count=41, rest_m=0.010, radius_m=0.008)
R = ROPE.radius_m


def joined(*parts: np.ndarray, count: int = 41, length_m: float = 0.40) -> np.ndarray:
    """Nodes (n, 3) at the height of a lying rope: the first `length_m` of a polygon."""
    line = np.concatenate(parts)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    assert arc[-1] >= length_m - 1e-9
    at = np.linspace(0.0, length_m, count)
    xy = np.stack([np.interp(at, arc, line[:, k]) for k in range(2)], axis=1)
    return np.concatenate([xy + np.array([0.5, 0.0]), np.full((count, 1), R)], axis=1)


def serpentine(gap_m: float, strand_m: float = 0.11) -> np.ndarray:
    """Strands beside one another, `gap_m` from middle to middle."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 12)
    bow = gap_m / 2 * np.stack([np.cos(angle), np.sin(angle) + 1], axis=1)
    parts, y = list[np.ndarray](), 0.0
    for k in range(5):
        ends = np.array([[0.0, y], [strand_m, y]])
        parts += [ends if k % 2 == 0 else ends[::-1]]
        parts += [bow * [1, 1] + [strand_m, y] if k % 2 == 0 else bow * [-1, 1] + [0.0, y]]
        y += gap_m
    return joined(*parts)


def hook(gap_m: float) -> np.ndarray:
    """A strand, and the end of the rope turned back beside it."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 12)
    bow = gap_m / 2 * np.stack([np.cos(angle), np.sin(angle) + 1], axis=1)
    return joined(
        np.array([[0.0, 0.0], [0.25, 0.0]]), bow + np.array([0.25, 0.0]), np.array([[0.25, gap_m], [0.0, gap_m]])
    )


def spiral(gap_m: float) -> np.ndarray:
    """A coil whose turns are `gap_m` apart."""
    angle = np.linspace(0.0, 8 * np.pi, 2000)
    radius = 0.014 + gap_m * angle / (2 * np.pi)
    return joined(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


FOLDED = {
    "serpentine": serpentine(2.3 * R),
    "hook": hook(2.2 * R),
    "spiral": spiral(2.5 * R),
}
TOUCHING = {"serpentine": serpentine(2.0 * R), "hook": hook(2.0 * R), "spiral": spiral(2.0 * R)}


def seen(nodes: np.ndarray, seed: int, *, count: int = 300, noise_m: float = 0.001) -> np.ndarray:
    """Particles of the rope in any order, with noise."""
    rng = np.random.default_rng(seed)
    x = fill_tube(nodes, R, count)[rng.permutation(count)]
    return (x + noise_m * rng.standard_normal(x.shape)).astype(np.float32)


def bent(seed: int) -> np.ndarray:
    """A rope at random whose strands may touch."""
    rng = np.random.default_rng(seed)
    return random_curve(
        rng, length_m=0.4, height_m=R, workspace=Workspace(), max_turn_rad=4.5, min_gap_m=2.05 * R, points=41
    )


# Recovery.


@pytest.mark.parametrize("name", FOLDED)
@pytest.mark.parametrize("count", [300, 2000])
def test_a_folded_rope_is_followed_along_its_strands(name: str, count: int) -> None:
    for seed in range(3):
        verdict = assess(seen(FOLDED[name], seed, count=count), ROPE)
        assert distance(verdict.line, FOLDED[name][:, :2]) < R / 2, seed


@pytest.mark.parametrize("name", TOUCHING)
def test_where_strands_touch_all_along_a_wrong_order_is_not_silent(name: str) -> None:
    for seed in range(4):
        verdict = assess(seen(TOUCHING[name], seed), ROPE)
        assert verdict.problems or distance(verdict.line, TOUCHING[name][:, :2]) < R, seed


@settings(max_examples=20)
@given(st.integers(0, 2**31 - 1))
def test_a_wrong_order_is_never_silent(seed: int) -> None:
    nodes = bent(seed)
    verdict = assess(seen(nodes, seed, noise_m=0.0015), ROPE)
    assert verdict.problems or distance(verdict.line, nodes[:, :2]) < R


@settings(max_examples=10)
@given(st.integers(0, 2**31 - 1))
def test_a_centreline_has_the_length_of_the_rope_in_equal_steps(seed: int) -> None:
    line = trace(seen(bent(seed), seed), ROPE).line
    assert np.linalg.norm(np.diff(line, axis=0), axis=1) == pytest.approx(np.full(40, ROPE.rest_m), rel=1e-2)


def round_ended(nodes: np.ndarray, seed: int) -> np.ndarray:
    """Particles of a rope with hemispheres at both ends, everywhere as dense, with noise."""
    rng, more = np.random.default_rng(seed), list[np.ndarray]()
    for end, inner in ((nodes[0], nodes[1]), (nodes[-1], nodes[-2])):
        ball = R * rng.uniform(-1.0, 1.0, (60, 3))
        more += [end + ball[(np.linalg.norm(ball, axis=1) < R) & (ball @ (end - inner) > 0)]]
    tube = fill_tube(nodes, R, round(60 / (2 * R) ** 3 * np.pi * R**2 * ROPE.length_m))
    x = np.concatenate([tube, *more])
    return (x + 0.001 * rng.standard_normal(x.shape)).astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
def test_round_ends_do_not_draw_the_nodes_outward_or_make_them_cut_bends(seed: int) -> None:
    nodes = bent(seed)
    x = round_ended(nodes, seed)
    start = RodState.at_rest(jnp.asarray(x)[None], ROPE.count, ROPE.rest_m, R).nodes[0, :2].T
    assert distance(np.asarray(start, np.float64), nodes[:, :2]) < R / 6


def denser_at_an_end(nodes: np.ndarray, rope: RopeShape, times: float, seed: int) -> np.ndarray:
    """Points at random of a rope of which a camera that stands near its last end sees more there, with noise."""
    rng, x = np.random.default_rng(seed), fill_tube(nodes, rope.radius_m, 1600)
    nearest = np.linalg.norm(x[:, None, :2] - nodes[None, :, :2], axis=2).argmin(1)
    chance = times ** (nearest / (len(nodes) - 1))
    x = x[rng.choice(len(x), 400, replace=False, p=chance / chance.sum())]
    return (x + 0.001 * rng.standard_normal(x.shape)).astype(np.float32)


@pytest.mark.parametrize("times", [2.0, 3.0])
@pytest.mark.parametrize(
    "rope", [ROPE, RopeShape(count=49, rest_m=0.0125, radius_m=0.005)], ids=["as in the task", "longer and thinner"]
)
def test_a_cloud_that_is_denser_towards_a_camera_does_not_move_the_nodes_there(rope: RopeShape, times: float) -> None:
    errors = list[float]()
    for seed in range(8):
        nodes = random_curve(
            np.random.default_rng(seed),
            length_m=rope.length_m,
            height_m=rope.radius_m,
            workspace=Workspace(),
            min_gap_m=5 * rope.radius_m,
            points=rope.count,
        )
        errors.append(distance(trace(denser_at_an_end(nodes, rope, times, seed), rope).line, nodes[:, :2]))
    assert np.median(errors) < 0.01 * rope.length_m


# Invariance.


@pytest.mark.parametrize("name", FOLDED)
def test_numbering_does_not_matter(name: str) -> None:
    x = seen(FOLDED[name], 0)
    shuffled = x[np.random.default_rng(1).permutation(len(x))]
    np.testing.assert_allclose(trace(shuffled, ROPE).line, trace(x, ROPE).line, atol=1e-4)


@pytest.mark.parametrize("name", FOLDED)
def test_a_mirrored_turned_and_shifted_rope_has_such_a_centreline(name: str) -> None:
    x = seen(FOLDED[name], 0)
    cos, sin = np.cos(0.7), np.sin(0.7)
    for motion in (np.diag([1.0, -1.0]), np.array([[cos, -sin], [sin, cos]])):
        moved = x.copy()
        moved[:, :2] = x[:, :2] @ motion.T + [0.1, -0.05]
        expected = trace(x, ROPE).line @ motion.T + [0.1, -0.05]
        assert distance(trace(moved, ROPE).line, expected) < 1e-3


# A predicted centreline.


def ring() -> np.ndarray:
    """A rope whose ends touch."""
    radius = 0.40 / (2 * np.pi)
    angle = np.linspace(0.0, 2 * np.pi, 400)
    return joined(1.001 * radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))


@pytest.mark.parametrize("first", [0, 13, 27])
def test_a_prediction_tells_where_a_ring_begins_and_which_way_it_runs(first: int) -> None:
    x = seen(ring(), 0)
    near = np.roll(ring()[:-1, :2], -first, axis=0)
    near = of_equal_steps(np.concatenate([near, near[:1]])[None] + [0.004, 0.002], ROPE.rest_m)[0]
    for given_line in (near, near[::-1].copy()):
        line = trace(x, ROPE, given_line).line
        assert np.linalg.norm(line - given_line, axis=1).mean() < R


def test_a_prediction_that_is_far_off_does_not_bend_what_is_seen() -> None:
    nodes = FOLDED["serpentine"]
    line = trace(seen(nodes, 0), ROPE, nodes[:, :2][:, ::-1] + 0.2).line
    assert distance(line, nodes[:, :2]) < R / 2


# Verdicts.


def beans() -> np.ndarray:
    rng = np.random.default_rng(0)
    middles = rng.uniform([0.3, -0.3], [0.7, 0.3], (30, 2))
    x = middles[rng.integers(30, size=300)] + 0.003 * rng.standard_normal((300, 2))
    return np.concatenate([x, rng.uniform(0.0, 2 * R, (300, 1))], axis=1).astype(np.float32)


def two_ropes() -> np.ndarray:
    one = seen(joined(np.array([[0.0, 0.0], [0.4, 0.0]])), 0, count=150)
    return np.concatenate([one, one + np.array([0.0, 0.1, 0.0], np.float32)])


def lying_over_itself() -> np.ndarray:
    """Two strands that cross, the upper one a diameter higher there."""
    tail = np.linspace([-0.1, -0.1], [0.1, 0.1], 100)
    other = np.linspace([0.1, -0.1], [-0.1, 0.1], 100)
    low = seen(joined(tail, count=41, length_m=0.2), 0, count=150)
    high = seen(joined(other, count=41, length_m=0.2), 1, count=150)
    crossed = np.linalg.norm(high[:, :2] - [0.5, 0.0], axis=1) < 0.03
    high[crossed, 2] += 2 * R
    return np.concatenate([low, high])


def straight(length_m: float) -> np.ndarray:
    return seen(joined(np.array([[0.0, 0.0], [length_m, 0.0]]), length_m=length_m), 0)


def block() -> np.ndarray:
    rng = np.random.default_rng(0)
    return (rng.uniform([-0.06, -0.06, 0.0], [0.06, 0.06, 2 * R], (300, 3)) + np.array([0.5, 0, 0])).astype(np.float32)


BAD = {
    "too few": (lambda: straight(0.4)[:60], "60 points.*particle_count"),
    "not finite": (lambda: np.where(np.arange(300)[:, None] == 7, np.nan, straight(0.4)).astype(np.float32), "finite"),
    "beans": (beans, "pieces"),
    "two ropes": (two_ropes, "2 pieces"),
    "longer": (lambda: straight(0.5), "longer than length_m"),
    "shorter": (lambda: straight(0.3), "shorter than length_m"),
    "lifted": (lambda: straight(0.4) + np.array([0, 0, 0.02], np.float32), "lifted"),
    "over itself": (lying_over_itself, "over itself"),
    "a ring": (lambda: seen(ring(), 0), "ends touch"),
    "a block": (block, "."),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_such_rope_is_named_in_one_line(name: str) -> None:
    make, words = BAD[name]
    with pytest.raises(PerceptionError, match=words) as raised:
        assess(make(), ROPE).valid_line()
    assert "\n" not in str(raised.value)
    assert str(raised.value).endswith(".")


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_said_against_an_open_rope(seed: int) -> None:
    curve = random_curve(
        np.random.default_rng(seed), length_m=0.4, height_m=R, workspace=Workspace(), points=41, min_gap_m=0.04
    )
    verdict = assess(seen(curve, seed), ROPE)
    assert verdict.problems == ()
    assert distance(verdict.valid_line(), curve[:, :2]) < R / 4


def test_lines_that_cross_are_told_from_those_that_do_not() -> None:
    assert not crossing(FOLDED["spiral"][:, :2])
    assert crossing(np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]))


# The state.


def test_particles_of_a_folded_rope_are_where_they_were() -> None:
    x = seen(FOLDED["serpentine"], 0)
    state = RodState.at_rest(jnp.asarray(x)[None], ROPE.count, ROPE.rest_m, R)
    assert np.asarray(state.x[0]) == pytest.approx(x, abs=1e-5)
    assert distance(np.asarray(state.nodes[0, :2]).T.astype(np.float64), FOLDED["serpentine"][:, :2]) < R / 2


def test_nodes_follow_particles_as_their_gradient_says() -> None:
    x = jnp.asarray(seen(FOLDED["hook"], 0))[None]
    toward = jnp.asarray(np.random.default_rng(0).standard_normal((2, ROPE.count)), jnp.float32)

    def product(moved: jax.Array) -> jax.Array:
        return (RodState.at_rest(moved, ROPE.count, ROPE.rest_m, R).nodes[0, :2] * toward).sum()

    # A shift of all particles changes no place along the rope, so that differences see what the gradient sees.
    slope = np.asarray(jax.grad(product)(x))[0, :, :2].sum(0)
    assert slope == pytest.approx(np.asarray(toward.sum(1)), rel=1e-3, abs=1e-3)


def test_a_state_begins_where_a_prediction_says() -> None:
    near = ring()[::-1, :2].T.copy()
    state = RodState.at_rest(jnp.asarray(seen(ring(), 0))[None], ROPE.count, ROPE.rest_m, R, jnp.asarray(near))
    assert np.linalg.norm(np.asarray(state.nodes[0, :2]) - near, axis=0).mean() < R


@pytest.mark.parametrize("count", [5, 20, 60])
def test_a_straight_rope_of_few_particles_has_its_nodes(count: int) -> None:
    x = np.concatenate([np.linspace([0.3, 0.0], [0.7, 0.0], count), np.full((count, 1), R)], axis=1)
    nodes = np.asarray(RodState.at_rest(jnp.asarray(x, jnp.float32)[None], ROPE.count, ROPE.rest_m).nodes[0, :2])
    assert nodes == pytest.approx(np.stack([np.linspace(0.3, 0.7, ROPE.count), np.zeros(ROPE.count)]), abs=1e-3)


def test_clouds_of_a_whole_calibration_are_traced_once(monkeypatch: pytest.MonkeyPatch):
    asked, line = list[bytes](), np.column_stack([np.linspace(0, 0.4, ROPE.count), np.zeros(ROPE.count)])

    def noted(x: np.ndarray, *_: object) -> SimpleNamespace:
        asked.append(x.tobytes())
        return SimpleNamespace(line=line)

    monkeypatch.setattr(state, "trace", noted)
    monkeypatch.setattr(state, "locate_particles", lambda x, *_: np.ones((2, len(x)), np.float32))
    clouds = np.random.default_rng(0).random((400, 12, 3)).astype(np.float32)
    for _ in range(2):
        RodState.at_rest(jnp.asarray(clouds), ROPE.count, ROPE.rest_m, R)
    assert len(asked) == len(set(asked)) == len(clouds)


def test_of_particles_that_are_there_the_start_is_that_of_a_program_and_a_prediction_compiles_nothing() -> None:
    """Programs that ask the host are kept on no disk, and one more for a prediction would be compiled in a session."""
    one, other = (jnp.asarray(seen(bent(seed), seed))[None] for seed in (1, 2))
    begin = RodStart(ROPE.count, ROPE.rest_m, ROPE.radius_m)
    found = begin(one)
    inside = jax.jit(begin)(one)
    for part, expected in zip(found, inside, strict=True):
        np.testing.assert_allclose(part, expected, atol=2e-6)
    predicted, began = jnp.asarray(np.asarray(found.centreline)[0]), list[str]()

    def note(event: str, _: float, **__: object) -> None:
        began.append(event)

    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        near = begin(other, predicted)
    finally:
        jax.monitoring.unregister_event_duration_listener(note)
    assert near.nodes.shape == found.nodes.shape
    assert not [event for event in began if "compile" in event]
