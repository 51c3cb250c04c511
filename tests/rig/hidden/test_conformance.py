"""Conformance of hidden effects, found by itself: nulls that change nothing, and the catalogue's names and sizes."""

import ast
import inspect
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.geometry.scene_description import Rope, Soup
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.dataset.object_kinds import GRAINS, SOUP
from app.jobs.discovery_subject import subject_of
from app.rig.simulated import injected_effects
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.effect_sampling import InjectionRequest, draw, injectable_effects, not_injectable
from app.rig.simulated.injected_effects.base import (
    ANY_BODY,
    LIQUIDS,
    ON_TABLES,
    ON_TABLES_OR_POURED,
    ROPES,
    SOLIDS,
    SOUPS,
    InjectedEffect,
    SensorImages,
)
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.sim.files import files_of
from app.tasks import load
from tests.rig.hidden.moments import track, world
from tests.rig.scene import PUSH_Z, ROPE

FILES, MODULES = injectable_effects(), dict(files_of(injected_effects))
CATALOGUE, ROD_CATALOGUE = catalogue(), catalogue(subject_of(load("rope_push@rods")).rods)
OF_LIQUIDS = catalogue(kind=SOUP)
"""Soup has all that water has."""
TASK = load("rope_push")
PAGE = (Path(__file__).parents[3] / "docs" / "hidden-effects.md").read_text(encoding="utf-8")
HEFT = TASK.scene.gravity_m_s2 / 9.81
FORBIDDEN = ("app.sim", "app.discovery", "app.perception", "app.planner")
every_effect = pytest.mark.parametrize("name", FILES)
catalogued = pytest.mark.parametrize("name", [name for name, effect in FILES.items() if effect.catalogued])
in_the_world = pytest.mark.parametrize(
    "name", [name for name, e in FILES.items() if (e.family == "physics" or e.build) and Rope in e.bodies]
)
in_liquids = pytest.mark.parametrize("name", [name for name, e in FILES.items() if e.in_world and Soup in e.bodies])


def nothing(name: str) -> InjectedEffect:
    effect = FILES[name]
    return InjectedEffect(name=name, effect=effect, values=np.array([quantity.null for quantity in effect.quantities]))


def typical(name: str, seed: int = 0) -> InjectedEffect:
    (drawn,) = draw([InjectionRequest(name, None)], seed, FILES[name].bodies[0])
    return drawn


def pushed(table: RopeWorld) -> np.ndarray:
    """The rope after a curved push through its middle, and a little later."""
    table.place(np.array([0.47, -0.02, PUSH_Z]))
    for share in np.linspace(0.05, 1.0, 20):
        table.step(np.array([0.47 + 0.08 * share, -0.02 + 0.06 * share**2, PUSH_Z]), 0.02)
    table.step(table.tool, 0.1)
    return table.nodes()


@pytest.fixture(scope="module")
def plain() -> np.ndarray:
    return pushed(world())


@in_the_world
def test_at_its_null_an_effect_leaves_the_world_as_it_is_to_the_last_bit(name: str, plain: np.ndarray) -> None:
    assert np.array_equal(pushed(world(nothing(name))), plain)


@every_effect
def test_at_its_null_an_effect_leaves_arm_and_cameras_as_they_are(name: str) -> None:
    effect, values = FILES[name], nothing(name).values
    if effect.drive is not None:
        made = effect.drive(track(), values)
        np.testing.assert_allclose(made.at(track().times_s), track().positions, atol=1e-12)
    if effect.stands is not None:
        pose = table_cameras()[0].T_world_camera
        np.testing.assert_allclose(effect.stands(pose, np.array([0.5, 0.0, 0.6]), values), pose, atol=1e-12)
    if effect.seen is not None:
        camera = table_cameras()[0]
        depth = np.random.default_rng(0).integers(0, 1000, (camera.height, camera.width)).astype(np.uint16)
        colour = np.zeros((camera.height, camera.width, 3), np.uint8) + np.array([200, 60, 25], np.uint8)
        assert np.array_equal(effect.seen(SensorImages(colour, depth, camera, ROPE.colour), values), depth)
    if effect.late_s is not None:
        assert effect.late_s(values) == 0.0
    if effect.more is not None:
        assert effect.more(values) == 0.0


@in_the_world
def test_at_its_typical_size_an_effect_of_the_world_moves_the_rope_otherwise(name: str, plain: np.ndarray) -> None:
    here = typical(name)
    # Where the rope is carried to, and a change before which the session begins.
    instead = {"_x": 0.53, "_y": 0.08, "step_time": -0.1}
    values = np.array(
        [
            next((at for end, at in instead.items() if quantity.name.endswith(end) and quantity.typical is None), value)
            for quantity, value in zip(here.effect.quantities, here.values, strict=True)
        ]
    )
    table = world(InjectedEffect(name=name, effect=here.effect, values=values))
    table.intrusion.session = -0.5
    assert 1e-6 < np.abs(pushed(table) - plain).max() < 0.1


@every_effect
def test_what_is_drawn_follows_from_the_seed_and_has_the_size_asked_for(name: str) -> None:
    effect, size = FILES[name], typical(name).effect.main.typical
    first, again, others = (
        np.array([typical(name, seed).values for seed in seeds]) for seeds in ((1,), (1,), range(9))
    )
    assert np.array_equal(first, again)
    sizes = [quantity.typical is not None and quantity.unit == effect.main.unit for quantity in effect.quantities]
    lengths = {round(float(np.linalg.norm(drawn[sizes])), 9) for drawn in others}
    several = sum(sizes) > 1 and name == "abrupt_change"
    assert lengths == {round(size * (np.sqrt(2) if several else 1.0), 9)}
    assert effect.main.low <= size <= effect.main.high


def test_everything_of_the_catalogue_can_be_hidden_or_is_said_to_be_impossible() -> None:
    of_rods = catalogue(subject_of(load("rope_push@rods")).rods)
    further = [OF_LIQUIDS, *(catalogue(kind=replace(GRAINS, name=name)) for name in ("grains", "cloth"))]
    causes = {cause.name for known in (CATALOGUE, of_rods, *further) for cause in known.causes}
    assert {name for name, effect in FILES.items() if effect.catalogued} == causes - set(not_injectable())
    assert set(not_injectable()) < causes
    others = {name for name, effect in FILES.items() if not effect.catalogued}
    assert len(others) >= 4
    assert not others & causes


@catalogued
def test_an_effect_has_the_names_units_nulls_and_typical_sizes_of_the_catalogue_in_real_units(name: str) -> None:
    effect, of_ropes = FILES[name], Rope in FILES[name].bodies
    known = CATALOGUE if of_ropes else OF_LIQUIDS
    scales = (TASK.time_scale, HEFT) if of_ropes else (1.0, 1.0)
    cause = known.cause(name)
    specs = [known.specs[column] for column in cause.columns]
    assert effect.family == cause.family
    assert [quantity.name for quantity in effect.quantities] == [spec.name for spec in specs]
    for quantity, spec in zip(effect.quantities, specs, strict=True):
        assert quantity.unit == spec.unit
        assert quantity.null == pytest.approx(spec.real(spec.nominal, *scales))
        if spec.typical is None or quantity.typical is None:
            assert spec.typical is None
            assert quantity.typical is None
        else:
            assert quantity.typical == pytest.approx(spec.real(spec.typical, *scales), rel=0.01)
            assert quantity.high <= 1.01 * spec.real(spec.high, *scales)


@in_liquids
def test_an_effect_in_liquids_has_the_typical_sizes_that_their_catalogue_says(name: str) -> None:
    main, cause = FILES[name].main_in(Soup), OF_LIQUIDS.cause(name)
    spec = OF_LIQUIDS.specs[cause.columns[0]]
    assert spec.typical is not None
    assert main.typical == pytest.approx(spec.typical, rel=0.01)
    assert main.high <= 1.01 * spec.high


@catalogued
def test_an_effect_has_the_typical_sizes_of_the_catalogue_of_rods(name: str) -> None:
    sizes = {quantity.name: quantity.typical for quantity in FILES[name].quantities}
    columns = [column for cause in ROD_CATALOGUE.causes if cause.name == name for column in cause.columns]
    for spec in (ROD_CATALOGUE.specs[column] for column in columns):
        if sizes[spec.name] is not None:
            assert spec.typical == pytest.approx(sizes[spec.name], rel=0.01)


@every_effect
def test_whether_encoders_see_an_effect_is_as_in_the_catalogue(name: str) -> None:
    told = {cause.name for cause in CATALOGUE.causes if cause.family == "actuation"} - {"tool_compliance"}
    assert FILES[name].told == (name in told)


@every_effect
def test_the_page_about_hidden_effects_has_its_row(name: str) -> None:
    main = FILES[name].main
    row = f"| `{name}` | {main.typical:g} | {main.unit} | {main.low:g} to {main.high:g} | "
    assert row in PAGE, f"docs/hidden-effects.md lacks: {row}"


@every_effect
def test_the_page_about_hidden_effects_says_which_objects_an_effect_can_be_in(name: str) -> None:
    named: dict[tuple[type, ...], str] = {
        ROPES: "ropes",
        ON_TABLES: "ropes, beans",
        SOLIDS: "ropes, beans, cloths",
        ON_TABLES_OR_POURED: "ropes, beans, liquids",
        LIQUIDS: "liquids",
        SOUPS: "soups",
        ANY_BODY: "any object",
    }
    said = named[FILES[name].bodies]
    (row,) = (line for line in PAGE.splitlines() if line.startswith(f"| `{name}` |"))
    assert row.split(" | ")[-1] == f"{said} |"


@every_effect
def test_an_effect_says_what_it_is_and_is_short(name: str) -> None:
    source = inspect.getsource(MODULES[name])
    assert (MODULES[name].__doc__ or "").partition("\n")[0].endswith(".")
    assert len(source.splitlines()) <= 70


@pytest.mark.parametrize(
    "file", sorted(Path(injected_effects.__file__).parent.glob("*.py")), ids=lambda file: file.stem
)
def test_an_effect_is_written_anew_and_imports_nothing_of_what_looks_for_it(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    imported = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    imported += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    assert not [module for module in imported if module.startswith(FORBIDDEN)]
