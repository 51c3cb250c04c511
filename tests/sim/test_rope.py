"""Laws of rope: it does not stretch, bends, and keeps its bend; and of the direction in which it runs."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.materials.base import Material
from app.sim.materials.elastic import Elastic
from app.sim.materials.rope import RopeMaterial
from app.sim.model.params import PARAMETERS, index, with_stiffness_up_to
from app.sim.model.scene import Body, Scene
from app.sim.runtime.directions import find_directions
from app.sim.runtime.rollout import make_rollout
from app.sim.state import Setting, State
from app.tasks.rope_push import TASK
from tests.sim.scenes import PARTICLES, SCENE, phi_with, rope, straight_tool

ROPE = RopeMaterial(fibre_pa=5e5, core_m=0.004, yield_strain=0.1)
USUAL_PA = 6e4
STRAIGHT = rope(300, length_m=0.4)
TIP, SPEED = np.array([0.51, -0.022, 0.006]), 0.75


def made_of(material: Material) -> Scene:
    """Scene of the pushed rope, with the mass of the task's."""
    (body,) = TASK.scene.bodies
    return replace(TASK.scene, damping_1_s=4.0, bodies=(replace(body, material=material),))


@cache
def bent(material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Particles (300, 3) along a rope whose middle is pushed by 0.10 m; and when the finger has been gone for long."""
    scene = made_of(material)
    steps = round(0.10 / SPEED / scene.dt_s)
    way = TIP + scene.dt_s * np.arange(steps + 1)[:, None] * np.array([0, SPEED, 0])
    gone = np.tile([0.3, 0.3, 0.2], (400, 1))
    simulate = make_rollout(scene, particle_count=300, effects=())
    phi = jnp.float32([[USUAL_PA, 0.5]])
    pushed = simulate(phi, State.at_rest(jnp.asarray(STRAIGHT)[None]), jnp.asarray(way, jnp.float32)[None])
    left = simulate(phi, pushed, jnp.asarray(gone, jnp.float32)[None])
    return np.asarray(pushed.x[0], np.float64), np.asarray(left.x[0], np.float64)


def length_m(x: np.ndarray) -> float:
    """Length of the line through the means of each ten particles of the rope's 300."""
    return float(np.linalg.norm(np.diff(x.reshape(30, 10, 3).mean(1), axis=0), axis=1).sum())


def peak_m(x: np.ndarray) -> float:
    """Distance [m] of the rope's middle ahead of its ends."""
    return float(x[140:160, 1].mean() - np.concatenate([x[:10], x[-10:]])[:, 1].mean())


def test_a_rope_that_is_dragged_hardly_grows_longer_where_an_elastic_rod_that_bends_as_easily_does():
    elastic, fibrous = (length_m(bent(material)[0]) / length_m(STRAIGHT) for material in (Elastic(), ROPE))
    assert fibrous < 1.06
    assert elastic - 1 > 2 * (fibrous - 1)


def test_a_rope_keeps_its_bend_where_an_elastic_rod_springs_back():
    kept = [peak_m(left) / peak_m(pushed) for pushed, left in (bent(ROPE), bent(Elastic()))]
    assert kept[0] > 0.93
    assert kept[1] < kept[0] - 0.03


def test_without_fibres_and_below_yield_it_is_elastic():
    weak = RopeMaterial(fibre_pa=0.0, core_m=0.004, yield_strain=1e3)
    assert np.abs(bent(weak)[0] - bent(Elastic())[0]).max() < 1e-4


def test_it_stays_whole_at_the_ends_of_the_range_of_stiffness():
    scene = made_of(ROPE)
    spec = with_stiffness_up_to(PARAMETERS, scene.stiffest_pa)[index("stiffness")]
    simulate = make_rollout(scene, particle_count=300, effects=())
    steps = round(0.15 / SPEED / scene.dt_s)
    way = TIP + scene.dt_s * np.arange(steps + 1)[:, None] * np.array([0, SPEED, 0])
    phi = jnp.float32([[stiffness, 0.5] for stiffness in (spec.low, USUAL_PA, spec.high)])
    state = State.at_rest(jnp.broadcast_to(jnp.asarray(STRAIGHT), (3, 300, 3)))
    end = np.asarray(simulate(phi, state, jnp.broadcast_to(jnp.asarray(way, jnp.float32), (3, *way.shape))).x)
    assert np.isfinite(end).all()
    assert [length_m(x) / length_m(STRAIGHT) for x in end[1:]] == pytest.approx([1.0] * 2, abs=0.09)


def test_its_gradient_equals_differences():
    scene = replace(SCENE, bodies=(Body(volume_m3=SCENE.bodies[0].volume_m3, density_kg_m3=800.0, material=ROPE),))
    simulate = make_rollout(scene, particle_count=PARTICLES, effects=())
    start, weight = jnp.asarray(rope())[None], jnp.asarray(np.random.default_rng(0).normal(size=(PARTICLES, 3)))
    tool = jnp.asarray(straight_tool((0.51, -0.03, 0.006), (0.0, 0.4, 0.0), 120))[None]
    phi = jnp.asarray(phi_with(stiffness=2e4)[None, :2])

    def sought(moved: jax.Array) -> jax.Array:
        return (simulate(phi, State.at_rest(start), tool + moved).x[0] * weight).sum()

    step = jnp.float32([0.0, 2e-4, 0.0])
    slope = float((sought(step) - sought(-step)) / (2 * step[1]))
    assert float(jax.grad(sought)(jnp.zeros(3))[1]) == pytest.approx(slope, rel=0.05)


def arc(radius_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Particles of a rope of 8 mm radius along an arc, their angle on it, and their offset to the outside [m]."""
    straight = rope(300, length_m=0.3)
    angle = (straight[:, 0] - 0.51) / radius_m
    out = straight[:, 1]
    x = np.stack([(radius_m + out) * np.cos(angle), (radius_m + out) * np.sin(angle), straight[:, 2]], axis=1)
    return x.astype(np.float32), angle, out


@pytest.mark.parametrize("radius_m", [0.05, 0.2])
def test_the_direction_of_a_bent_rope_and_the_offset_from_its_middle_are_seen(radius_m: float):
    x, angle, out = arc(radius_m)
    label = np.asarray(find_directions(made_of(ROPE), Setting.unknown(1, 300), jnp.asarray(x)[None]).label[0])
    inner = np.abs(angle * radius_m) < 0.13
    tangent = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    agreement = np.abs((label[:, 2:] * tangent).sum(1))[inner]
    assert np.rad2deg(np.arccos(np.minimum(agreement, 1))).mean() < 8
    assert np.abs(np.abs(label[inner, 1]) - np.abs(out[inner])).mean() < 1.5e-3
    assert not label[:, 0].any()


def test_what_is_known_of_directions_is_kept_and_what_needs_none_is_left_alone():
    known = Setting.unknown(1, PARTICLES)._replace(label=jnp.full((1, PARTICLES, 4), 0.5))
    x = jnp.asarray(rope())[None]
    assert np.array_equal(find_directions(made_of(ROPE), known, x).label, known.label)
    unknown = Setting.unknown(1, PARTICLES)
    assert find_directions(SCENE, unknown, x) is unknown
