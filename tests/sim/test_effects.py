"""Conformance of effect files, found by itself, and adding one as `docs/effects.md` says."""

import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.sim import effects
from app.sim.effect_composition import GRAIN_HOOKS, NODE_HOOKS
from app.sim.effects.base import Effect
from app.sim.materials.granular import Granular
from app.sim.materials.liquid import LiquidMaterial
from app.sim.model import catalogue
from app.sim.model.catalogue import discover
from app.sim.model.params import NOMINAL_PHYSICS, PARAMETERS, nominal_phi, parameters_with
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import Setting, State
from tests.sim.scenes import SCENE, block, rope, straight_tool

CATALOGUE = discover()
DOCS = Path(__file__).parents[2] / "docs" / "effects.md"
STEPS = 60
NOMINAL = len(NOMINAL_PHYSICS)
LOW, HIGH = (np.array([getattr(spec, end) for spec in PARAMETERS]) for end in ("low", "high"))
SPAN = HIGH - LOW
every_effect = pytest.mark.parametrize("name", CATALOGUE)
OF_POINTS = [
    name for name, effect in CATALOGUE.items() if any(getattr(effect, hook) for hook in NODE_HOOKS + GRAIN_HOOKS)
]
of_material_points = pytest.mark.parametrize("name", OF_POINTS)

EXACT = 1e-6 if jax.default_backend() == "cpu" else 1e-4
"""Largest relative difference between two runs of one model; on a GPU, threads add up in any order."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Matter in motion, in contact with the table and with a finger that comes and goes again."""

    scene: Scene
    start: State
    tool: jax.Array
    setting: Setting

    @cache  # noqa: B019 - cases are few and live as long as the tests.
    def simulate(self, *, nominal: bool = False) -> Simulate:
        return make_rollout(self.scene, particle_count=self.start.x.shape[1], **({"effects": ()} if nominal else {}))

    def weights(self) -> jax.Array:
        """Random weights (2, N, 3), by which the differentiated value is a sum in which nothing cancels."""
        return jnp.asarray(np.random.default_rng(5).normal(0.5, 1.0, (2, *self.start.x.shape[1:])), jnp.float32)

    def ends(self, phi: np.ndarray) -> State:
        """State at the end, with one candidate for each row of phi."""
        many = jax.tree.map(lambda part: jnp.repeat(part, len(phi), axis=0), (self.start, self.tool, self.setting))
        return self.simulate()(jnp.asarray(phi, jnp.float32), *many)


def moving(x: np.ndarray, *, speed: float, strain: float = 0.0) -> State:
    """Particles at x that drift and jitter, so that every direction of motion and of stress occurs."""
    rng = np.random.default_rng(1)
    start = State.at_rest(jnp.asarray(x)[None])
    v = np.float32([0.05, 0.10, 0.0]) + rng.normal(0, speed, start.v.shape)
    F = start.F + rng.normal(0, strain, start.F.shape)
    return start._replace(v=jnp.asarray(v, jnp.float32), F=jnp.asarray(F, jnp.float32))


def there_and_back(x_m: float, y_m: float) -> jax.Array:
    """A finger that pushes along +y at 0.3 m/s and then retreats."""
    there = straight_tool((x_m, y_m, 0.005), (0.0, 0.3, 0.0), STEPS * 3 // 5)
    back = straight_tool(tuple(there[-1]), (0.0, -0.3, 0.0), STEPS - len(there) + 1)
    return jnp.asarray(np.concatenate([there, back[1:]]))[None]


def piled(material: Granular | LiquidMaterial, *, speed: float) -> Case:
    x = block(4, spacing_m=0.006, low=(0.50, -0.012, 0.0))
    body = Body(volume_m3=0.024**3, density_kg_m3=1000.0, material=material)
    return Case(
        scene=replace(SCENE, bodies=(body,)),
        start=moving(x, speed=speed, strain=0.01),
        tool=there_and_back(0.512, -0.026),
        setting=Setting.unknown(1, len(x))._replace(time=jnp.array([-0.3])),
    )


def roped() -> Case:
    x = rope()
    label = np.stack([(x[:, 0] - 0.51) / 0.04, x[:, 1], np.full(len(x), 0.96), np.full(len(x), 0.28)], axis=1)
    return Case(
        scene=SCENE,
        start=moving(x, speed=0.05, strain=0.05),
        tool=there_and_back(0.515, -0.020),
        setting=Setting(label=jnp.asarray(label)[None], time=jnp.array([0.3])),
    )


CASES = {
    "rope": roped(),
    "beans": piled(Granular(), speed=0.02),
    "syrup": piled(LiquidMaterial(viscosity_pa_s=8.0), speed=0.2),
}


def switches(effect: Effect) -> list[int]:
    """Columns of phi that switch the effect off."""
    return [PARAMETERS.index(spec) for spec in effect.parameters[: effect.switches]]


def null() -> np.ndarray:
    return nominal_phi().astype(np.float64)


def typical() -> np.ndarray:
    """All effects at once: switches at a seventh of their ranges, the rest a little beside their nominal values."""
    phi = null()
    for effect in CATALOGUE.values():
        own = [PARAMETERS.index(spec) for spec in effect.parameters]
        for column in own:
            end = HIGH[column] if HIGH[column] > phi[column] else LOW[column]
            phi[column] += (0.15 if column in switches(effect) else 0.02) * (end - phi[column])
    return phi


POINTS: dict[str, Callable[[], np.ndarray]] = {"null": null, "typical": typical}
every_point = pytest.mark.parametrize("point", POINTS)


@cache
def gradient(case: str, point: str) -> np.ndarray:
    """Gradient of a weighted sum of positions [mm] and velocities [dm/s], by one backward pass."""
    it = CASES[case]
    w, u = it.weights()

    def value(phi: jax.Array) -> jax.Array:
        end = it.simulate()(phi[None], it.start, it.tool, it.setting)
        return 1e3 * (w * end.x[0]).mean() + 1e1 * (u * end.v[0]).mean()

    return np.asarray(jax.grad(value)(jnp.asarray(POINTS[point](), jnp.float32)), np.float64)


STEPS_OF_SPAN = (3e-4, 3e-3, 2e-2)
ONE_SIDED = np.array([-7 / 4, 8 / 3, -1, 1 / 12])
"""Weights of the values at 0, 1, 2 and 4 steps in a one-sided slope."""


@cache
def differences(case: str, point: str) -> np.ndarray:
    """Gradient (3, P) by differences with three sizes of steps, in one batch.

    Central of fourth order where the range goes on, else one-sided (Fornberg 1988).
    """
    it, phi = CASES[case], POINTS[point]()
    step = np.array(STEPS_OF_SPAN)[:, None] * SPAN
    up, down = (phi + 4 * step <= HIGH)[..., None], (phi - 4 * step >= LOW)[..., None]
    side = np.where(up, 1, -1)
    offsets = np.where(up & down, [-2, -1, 1, 2], side * np.array([0, 1, 2, 4]))
    shares = np.where(up & down, [1 / 12, -2 / 3, 2 / 3, -1 / 12], side * ONE_SIDED)
    rows = phi + (offsets * step[..., None])[..., None] * np.eye(len(phi))[:, None, :]
    end = it.ends(rows.reshape(-1, len(phi)))
    w, u = np.asarray(it.weights(), np.float64)
    values = 1e3 * (w * np.asarray(end.x, np.float64)).mean((1, 2)) + 1e1 * (u * np.asarray(end.v)).mean((1, 2))
    return (shares * values.reshape(offsets.shape)).sum(-1) / step


def where_it_acts(column: int, point: str) -> list[str]:
    """Cases in which a parameter acts by at least a tenth of the most that it does in any."""
    sizes = {case: abs(gradient(case, point)[column]) for case in CASES}
    return [case for case, size in sizes.items() if size >= 0.1 * max(sizes.values())]


def test_with_all_switches_at_their_null_values_it_is_the_nominal_model():
    rng = np.random.default_rng(0)
    for case in CASES.values():
        phi = np.tile(null(), (8, 1))
        phi[1:] = LOW + rng.random((7, len(LOW))) * SPAN
        off = [*range(NOMINAL), *(column for effect in CATALOGUE.values() for column in switches(effect))]
        phi[:, off] = null()[off]
        bare = jnp.asarray(null()[None, :NOMINAL], jnp.float32)
        nominal = case.simulate(nominal=True)(bare, case.start, case.tool, case.setting)
        for ours, theirs in zip(case.ends(phi), nominal, strict=True):
            assert np.abs(ours - theirs).max() <= EXACT * np.abs(theirs).max()


@pytest.mark.parametrize("case", CASES)
def test_at_the_null_the_backward_pass_is_the_nominal_models_too(case: str):
    it = CASES[case]
    w, u = it.weights()

    def bars(simulate: Simulate, phi: np.ndarray) -> tuple[State, jax.Array]:
        def value(start: State, tool: jax.Array) -> jax.Array:
            end = simulate(jnp.asarray(phi, jnp.float32)[None], start, tool, it.setting)
            return (w * end.x[0]).sum() + (u * end.v[0]).sum()

        return jax.grad(value, argnums=(0, 1))(it.start, it.tool)

    ours = jax.tree.leaves(bars(it.simulate(), null()))
    theirs = jax.tree.leaves(bars(it.simulate(nominal=True), null()[:NOMINAL]))
    for our, their in zip(ours, theirs, strict=True):
        assert np.abs(our - their).max() <= 1e2 * EXACT * np.abs(their).max()


@every_point
@every_effect
def test_its_gradient_is_finite_and_equals_differences(name: str, point: str):
    """Equal in one of the cases where it acts, for one of the steps.

    Small steps drown in rounding where a parameter does little, and large ones cross kinks where it does much.
    """
    for column in (PARAMETERS.index(spec) for spec in CATALOGUE[name].parameters):
        found: dict[str, tuple[float, list[float], float]] = {}
        for case in where_it_acts(column, point):
            slope = gradient(case, point) * SPAN
            assert np.isfinite(slope).all()
            expected = differences(case, point)[:, column] * SPAN[column]
            floor = 1e-3 * np.abs(slope[NOMINAL:]).max()
            found[case] = (slope[column], list(expected), floor)
        agree = [
            slope == pytest.approx(one, rel=0.05, abs=floor)
            for slope, expected, floor in found.values()
            for one in expected
        ]
        assert any(agree), f"{PARAMETERS[column].name}: {found}"


@of_material_points
def test_one_of_its_switches_has_a_response(name: str):
    """Response at the null, or at a typical size where its physics is one-sided there (a yield stress)."""
    columns = switches(CATALOGUE[name])
    assert columns
    assert max(np.abs(differences(case, point)[-1] * SPAN)[columns].max() for case in CASES for point in POINTS) > 0.02


def test_the_stiffness_of_pieces_is_none_of_the_liquid_that_they_swim_in():
    column = [spec.name for spec in PARAMETERS].index("piece_stiffness")
    softer = null()
    softer[column] = 0.4
    ends = {name: np.asarray(it.ends(np.stack([null(), softer])).x) for name, it in CASES.items()}
    moved = {name: np.ptp(x, axis=0).max() for name, x in ends.items()}
    assert moved["syrup"] == 0.0
    assert moved["rope"] > 1e-5


def test_an_effect_acts_on_material_points_or_on_rods_and_else_is_none():
    assert {name for name, effect in CATALOGUE.items() if effect.rod is None} <= set(OF_POINTS)
    assert {name for name in CATALOGUE if name not in OF_POINTS} == {"permanent_set"}


@every_effect
def test_it_stays_finite_up_to_the_ends_of_its_ranges(name: str):
    columns = [PARAMETERS.index(spec) for spec in CATALOGUE[name].parameters]
    for case in CASES:
        assert np.isfinite(at_the_ends(case)[:, columns]).all()


@cache
def at_the_ends(case: str) -> np.ndarray:
    """The fastest particle's speed (2, P) [m/s] with one parameter at its lower or upper end."""
    phi = null()
    rows = np.concatenate([phi + np.diag(end - phi) for end in (LOW, HIGH)])
    return np.abs(CASES[case].ends(rows).v).max((1, 2)).reshape(2, -1)


@every_effect
def test_it_says_what_it_is_and_where_it_is_from(name: str):
    effect = CATALOGUE[name]
    source = inspect.getdoc(sys.modules[f"app.sim.effects.{name}"]) or ""
    assert effect.parameters
    assert re.search(r"\b(1[5-9]|20)\d\d\b", source), "An equation has a source, and that has a year."
    for spec in effect.parameters:
        assert spec.unit
        assert spec.about.endswith(".")
        assert np.isfinite([spec.low, spec.nominal, spec.high]).all()
        assert spec.low <= spec.nominal <= spec.high
        assert spec.low < spec.high


@every_effect
def test_what_makes_it_vanish_has_a_typical_value_other_than_its_null(name: str):
    effect = CATALOGUE[name]
    for spec in effect.parameters[: effect.switches]:
        assert spec.typical is not None
        assert spec.typical != spec.nominal


def test_every_parameter_name_is_its_own():
    assert len({spec.name for spec in PARAMETERS}) == len(PARAMETERS)


def test_an_effect_is_read_in_a_minute():
    for name in CATALOGUE:
        assert len(inspect.getsource(sys.modules[f"app.sim.effects.{name}"]).splitlines()) <= 60


def table() -> str:
    """The catalogue as the documentation shows it."""
    rows = [
        f"| `{name}` | `{spec.name}` | {spec.unit} | {spec.nominal:g} | {spec.low:g} to {spec.high:g} | {spec.about} |"
        for name, effect in CATALOGUE.items()
        for spec in effect.parameters
    ]
    head = "| Effect | Parameter | Unit | Null | Range | What it is |\n|---|---|---|---|---|---|\n"
    return head + "\n".join(rows) + "\n"


def test_the_documentation_lists_the_whole_catalogue():
    assert table() in DOCS.read_text(), f"Put this into docs/effects.md:\n\n{table()}"


@pytest.fixture
def folder_with_the_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The effects' folder with one more file in it: the one that the documentation shows."""
    (example,) = re.findall(r"```python\n(.*?)```", DOCS.read_text(), flags=re.DOTALL)
    (tmp_path / "wind.py").write_text(example)
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "app.sim.effects.wind", raising=False)
    return tmp_path


def test_a_new_effect_is_one_new_file_as_the_documentation_says(folder_with_the_example: Path):
    found = discover()
    assert set(found) == {*CATALOGUE, "wind"}
    assert parameters_with(tuple(found.values()))[-1].name == "wind"
    it = CASES["rope"]
    simulate = make_rollout(SCENE, particle_count=it.start.x.shape[1], effects=(found["wind"],))
    calm = jnp.append(jnp.asarray(nominal_phi()[:NOMINAL]), 0.0)

    def mean_y(phi: jax.Array) -> jax.Array:
        return simulate(phi[None], it.start, it.tool, it.setting).x[..., 1].mean()

    assert mean_y(calm.at[-1].set(5.0)) > mean_y(calm) + 1e-5
    assert float(jax.grad(mean_y)(calm)[-1]) > 0


def test_a_file_without_an_effect_is_named(folder_with_the_example: Path):
    (folder_with_the_example / "empty.py").write_text("")
    with pytest.raises(TypeError, match=r"effects/empty\.py must define EFFECT"):
        catalogue.discover()
