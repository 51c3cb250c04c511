"""A cell in lock step with something hidden in it: its arm goes other ways than it says, and its world is another."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.scene_description import Rope, Stage
from app.core.motion import Motion
from app.rig.simulated.effect_sampling import InjectionRequest, describe, draw, mistune
from app.rig.simulated.hidden_world import HiddenWorld, load_hidden_world
from app.rig.simulated.lockstep import LockStep
from app.rig.simulated.worlds.physics import ROPE_WORLDS
from app.tasks import load
from tests.rig.scene import FINGER, ROPE, approved, push, straight_rope

SITE = Site()
STAGE = Stage(body=ROPE, tool=FINGER)
PUSH = push((0.46, 0.0), (0.52, 0.0))


def hiding(*requests: InjectionRequest) -> HiddenWorld:
    return HiddenWorld(physics=ROPE_WORLDS["chain"], effects=draw(requests, 3, Rope))


def cell(hidden: HiddenWorld | None) -> LockStep:
    return LockStep(STAGE, straight_rope(), SITE, 0, hidden)


def moved_m(hidden: HiddenWorld | None) -> float:
    """Way of the rope along x."""
    world = cell(hidden)
    before = world.nodes()
    world.execute(approved(PUSH))
    return float((world.nodes() - before)[:, 0].max())


def test_where_nothing_is_hidden_all_is_as_ever() -> None:
    plain, hidden = cell(None), cell(hiding())
    executed = [each.execute(approved(PUSH)) for each in (plain, hidden)]
    np.testing.assert_array_equal(plain.nodes(), hidden.nodes())
    for name in ("times_s", "commanded", "measured"):
        np.testing.assert_array_equal(*(getattr(each, name) for each in executed))


def test_a_stroke_of_another_length_moves_the_rope_otherwise_and_the_encoders_tell() -> None:
    hidden = hiding(InjectionRequest("under_reach", 0.2))
    share = float(hidden.effects[0].values[0])
    world = cell(hidden)
    executed = world.execute(approved(PUSH))
    down = executed.measured[:, 2] < 0.02
    assert np.ptp(executed.measured[down, 0]) == pytest.approx((1 - share) * 0.06, abs=1e-3)
    assert np.ptp(executed.commanded[down, 0]) == pytest.approx(0.06, abs=1e-3)
    assert np.sign(moved_m(hidden) - moved_m(None)) == -np.sign(share)


def test_a_tip_that_is_elsewhere_is_so_from_the_first_and_no_encoder_tells() -> None:
    hidden = hiding(InjectionRequest("tcp_offset", 0.01))
    world = cell(hidden)
    assert np.linalg.norm(world.tip[:3] - world.tool[:3]) == pytest.approx(0.01)
    executed = world.execute(approved(PUSH))
    assert np.linalg.norm(world.tip[:3] - world.tool[:3]) == pytest.approx(0.01)
    np.testing.assert_allclose(executed.measured, executed.commanded, atol=2e-3)


def test_what_comes_late_goes_the_same_way_and_is_logged_to_its_end() -> None:
    prompt, late = cell(None), cell(hiding(InjectionRequest("command_delay", 0.3)))
    logs = [each.execute(approved(PUSH)) for each in (prompt, late)]
    durations = [np.ptp(each.times_s) for each in logs]
    assert durations[1] - durations[0] == pytest.approx(0.3, abs=0.02)
    np.testing.assert_allclose(logs[1].measured[-1], logs[0].measured[-1], atol=1e-9)
    assert np.abs(late.nodes() - prompt.nodes()).max() < 2e-3


def test_frictions_are_those_of_the_world() -> None:
    assert moved_m(HiddenWorld(physics=mistune(5), effects=())) != moved_m(None)


def test_a_fuller_bowl_holds_more_at_the_same_place() -> None:
    task = load("pour_water")
    hidden = HiddenWorld(
        physics=mistune(4, body=task.stage.body),
        effects=draw([InjectionRequest("fill_level", 0.2)], 4, type(task.stage.body)),
    )
    plain, filled = (LockStep(task.stage, task.start(0), SITE, 0, each) for each in (None, hidden))
    tops = [np.quantile(each.nodes()[:, 2], 0.99) for each in (plain, filled)]
    assert np.sign(tops[1] - tops[0]) == np.sign(hidden.more) != 0
    np.testing.assert_allclose(filled.tool, plain.tool)
    np.testing.assert_allclose(filled.nodes()[:, :2].mean(0), plain.nodes()[:, :2].mean(0), atol=1e-3)


def sealed(folder: Path, hidden: HiddenWorld, task: str = "rope_push", seed: int = 6) -> Path:
    path = folder / "truth.json"
    path.write_text(json.dumps({"task": task, "seed": seed, "effects": describe(hidden.effects)}))
    return path


def test_a_sealed_file_tells_all_of_its_world(tmp_path: Path) -> None:
    hidden = hiding(InjectionRequest("under_reach", 0.1), InjectionRequest("table_tilt", 2.0))
    found = load_hidden_world(sealed(tmp_path, hidden), "rope_push@rods", load("rope_push").stage.body)
    assert found.physics == mistune(6, "chain", load("rope_push").rope)
    assert [each.name for each in found.effects] == [each.name for each in hidden.effects]
    for mine, its in zip(found.effects, hidden.effects, strict=True):
        np.testing.assert_array_equal(mine.values, its.values)
    assert str(found).startswith("table_tilt ")
    assert str(hidden) != str(found)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("no json", "is no sealed file"),
        ('{"task": "rope_push", "seed": 1}', "is no sealed file"),
        ('{"task": "rope_push", "seed": -1, "effects": []}', "is no sealed file"),
        ('{"task": "bean_sweep", "seed": 1, "effects": []}', "is about bean_sweep"),
        ('{"task": "rope_push", "seed": 1, "effects": [{"effect": "nothing", "parameters": {}}]}', "nothing"),
        ('{"task": "rope_push", "seed": 1, "effects": [{"effect": "fill_level", "parameters": {}}]}', "can have"),
    ],
)
def test_a_file_that_is_of_no_such_world_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "truth.json"
    path.write_text(text)
    with pytest.raises(UsageError, match=said) as refused:
        load_hidden_world(path, "rope_push", load("rope_push").stage.body)
    assert "\n" not in str(refused.value)


def test_errors_of_cameras_are_told_apart() -> None:
    assert hiding(InjectionRequest("hand_eye_translation", 0.01)).in_images == ("hand_eye_translation",)
    assert hiding(InjectionRequest("tcp_offset", 0.01)).in_images == ()


def test_a_tool_that_holds_goes_on_from_where_its_last_motion_left_it() -> None:
    """Water is not thrown out where a stroke that fell short is followed by another."""
    task = load("pour_water")
    hidden = HiddenWorld(
        physics=mistune(4, body=task.stage.body),
        effects=draw([InjectionRequest("under_reach", 0.2)], 4, type(task.stage.body)),
    )
    world = LockStep(task.stage, task.start(0), SITE, 0, hidden)
    for _ in range(2):
        there = world.tool[:3] + np.array([0.05, 0.0, 0.0])
        world.execute(
            approved(Motion(positions=np.stack([world.tool[:3], there]), speeds=np.full(2, 0.1), continues=True))
        )
    away = np.linalg.norm(world.nodes() - world.tip[:3], axis=1)
    assert (away < task.stage.tool.radius_m + task.stage.tool.thickness_m).mean() > 0.99
