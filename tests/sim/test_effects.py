"""What every effect file keeps, found by itself, and what it takes to add one."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.sim import catalogue, effects
from app.sim.catalogue import EFFECTS, discover
from app.sim.params import NOMINAL_PHYSICS, PARAMETERS, nominal_phi, parameters_with
from app.sim.rollout import Simulate, make_rollout
from app.sim.state import State
from tests.sim.scenes import PARTICLES, SCENE, rope, straight_tool

STEPS = 60
ADDED = [spec for effect in EFFECTS for spec in effect.parameters]

WIND = '''
"""A steady wind along y."""

from typing import Any

import warp as wp

from app.sim.effects.base import Effect, Node
from app.sim.parameter import ParameterSpec


@wp.func
def blown(v: wp.vec3, node: Node, phi: Any, at: int) -> wp.vec3:
    return v + wp.vec3(0.0, phi[at] * node.dt, 0.0)


EFFECT = Effect(
    parameters=(
        ParameterSpec(
            name="wind", unit="m/s^2", nominal=0.0, low=-5.0, high=5.0, scale="linear", about="Acceleration along y."
        ),
    ),
    node_velocity=blown,
)
'''


def problem(phi: np.ndarray) -> tuple[jax.Array, State, jax.Array]:
    """A rope that a finger pushes."""
    tool = straight_tool((0.51, -0.022, 0.005), (0, 0.3, 0), STEPS)
    return jnp.asarray(phi)[None], State.at_rest(jnp.asarray(rope())[None]), jnp.asarray(tool)[None]


def mean_y(simulate: Simulate, phi: jax.Array) -> jax.Array:
    _, state, tool = problem(nominal_phi())
    return 1e3 * simulate(phi[None], state, tool).x[..., 1].mean()


def test_all_effects_at_their_null_values_are_the_nominal_model():
    nominal = make_rollout(SCENE, particle_count=PARTICLES, effects=())
    extended = make_rollout(SCENE, particle_count=PARTICLES)
    bare = problem(nominal_phi()[: len(NOMINAL_PHYSICS)])
    # On a GPU two runs of the same model differ by this much, as its threads add up in any order.
    tolerance = 1e-6 if jax.default_backend() == "cpu" else 1e-4
    for ours, theirs in zip(extended(*problem(nominal_phi())), nominal(*bare), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * float(np.abs(theirs).max()))


@pytest.mark.parametrize("spec", ADDED, ids=lambda spec: spec.name)
def test_the_gradient_at_the_null_is_finite_and_equals_central_differences(spec):
    simulate = make_rollout(SCENE, particle_count=PARTICLES)
    column = PARAMETERS.index(spec)
    nominal = jnp.asarray(nominal_phi())
    gradient = jax.grad(lambda phi: mean_y(simulate, phi))(nominal)
    assert np.isfinite(gradient).all()
    step = np.zeros(len(PARAMETERS), np.float32)
    step[column] = 0.02 * (spec.high - spec.low)
    difference = (mean_y(simulate, nominal + step) - mean_y(simulate, nominal - step)) / (2 * step[column])
    assert gradient[column] != 0
    assert float(gradient[column]) == pytest.approx(float(difference), rel=0.05)


def test_a_viscous_film_holds_the_rope_back():
    simulate = make_rollout(SCENE, particle_count=PARTICLES)
    phi = nominal_phi()
    phi[[spec.name for spec in PARAMETERS].index("film_drag")] = 30.0
    assert mean_y(simulate, jnp.asarray(phi)) < mean_y(simulate, jnp.asarray(nominal_phi())) - 0.05


@pytest.fixture
def folder_with_wind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The effects' folder with one more file in it."""
    (tmp_path / "wind.py").write_text(WIND)
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    monkeypatch.delitem(__import__("sys").modules, "app.sim.effects.wind", raising=False)
    return tmp_path


def test_a_new_effect_is_one_new_file(folder_with_wind: Path):
    found = discover()
    assert sorted(found) == sorted([*(name for name in found if name != "wind"), "wind"])
    assert parameters_with(tuple(found.values()))[-1].name == "wind"
    simulate = make_rollout(SCENE, particle_count=PARTICLES, effects=tuple(found.values()))
    phi = np.append(nominal_phi(), np.float32(0.0))
    gradient = jax.grad(lambda at: mean_y(simulate, at))(jnp.asarray(phi))
    blown = mean_y(simulate, jnp.asarray(phi).at[-1].set(5.0)) - mean_y(simulate, jnp.asarray(phi))
    assert blown > 0
    assert float(gradient[-1]) > 0


def test_a_file_without_an_effect_is_named(folder_with_wind: Path):
    (folder_with_wind / "empty.py").write_text("")
    with pytest.raises(TypeError, match=r"effects/empty\.py must define EFFECT"):
        catalogue.discover()


def test_every_effect_says_what_it_is_and_every_parameter_name_is_its_own():
    assert all(spec.about.endswith(".") and spec.unit for spec in PARAMETERS)
    assert len({spec.name for spec in PARAMETERS}) == len(PARAMETERS)
