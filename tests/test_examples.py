"""Each example does what its first lines say: what it returns and prints is asserted on, with small recordings."""

import importlib.util
import re
from functools import cache
from pathlib import Path
from types import ModuleType

import jax
import numpy as np
import pytest

from app.core.geometry.chamfer import chamfer_m2
from app.discovery.dataset.study import Study
from app.planner.search.budget import tree_rollouts
from app.policy.random_pushes import PushDesign
from app.recording.exchange.model_file import load_model
from app.recording.read.reader import read_messages, read_transitions
from app.tasks import load
from bench.hidden.draws import Chosen
from bench.hidden.recorded import write
from bench.hidden.ropes import RopeCase
from tests.commands.test_train import demonstration
from tests.planner.table import search
from tests.planner.test_methods import DESCENT, bowl, simulated

FILES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
MAX_LINES = 59
CASE = RopeCase(seed=4012, hidden=(Chosen(effect="tcp_offset", size=1.25),), plan=PushDesign(episodes=3, pushes=3))
"""A rope of its own sizes, pushed nine times by a finger whose tip is not where the arm says it is."""


@cache
def example(name: str) -> ModuleType:
    """The example as a module, as a program that imports it has it."""
    (file,) = (file for file in FILES if file.stem == name)
    spec = importlib.util.spec_from_file_location(f"example_{name}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def study() -> Study:
    return CASE.record()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return tuple(write(study(), tmp_path_factory.mktemp("rope") / "recordings"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_example_is_short_and_says_how_it_is_started(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MAX_LINES
    assert f"`python examples/{file.name}" in (example(file.stem).__doc__ or "")
    assert not re.search(r"(import|from) .*\b_[a-z]", text), "an example uses what is public alone"


@pytest.mark.slow
@pytest.mark.serial
def test_a_run_ends_where_it_promised_and_leaves_a_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = example("00_run").main(seed=8, pushes=1, recordings=tmp_path)
    assert report.failure is None
    first_m2, last_m2 = report.summary.chamfer_m2
    assert last_m2 < first_m2
    assert sum(1 for _ in read_messages(report.recording)) == report.recorded
    assert str(report.recording) in capsys.readouterr().out


def test_a_recording_is_read_as_it_was_made(recordings: tuple[Path, ...], capsys: pytest.CaptureFixture[str]) -> None:
    pushes = example("01_recording").main(recordings[0])
    made = [push for push in study().pushes if push.episode == 0]
    assert len(pushes) == len(made) == 3
    for push, its in zip(pushes, made, strict=True):
        np.testing.assert_array_equal(push.executed.commanded, its.command.poses)
        np.testing.assert_array_equal(push.after, its.after.points)
    told = capsys.readouterr().out
    assert "9 clouds of 300 particles" in told
    moved_mm = [float(moved) for moved in re.findall(r"the object moved by ([\d.]+) mm", told)]
    assert min(moved_mm) > 5.0


@pytest.mark.slow
def test_a_calibration_predicts_far_better_than_no_motion_and_is_kept(
    recordings: tuple[Path, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "model.toml"
    model = example("02_calibrate").main(recordings, output=output)
    pushes = [push for path in recordings for push in read_transitions(path)]
    still_m2 = np.mean([chamfer_m2(push.before, push.after) for push in pushes])
    assert model.loss_m2 < 0.1 * still_m2
    kept, told = load_model(output, task=model.task, time_s=0.0), capsys.readouterr().out
    assert kept.parameters == model.parameters
    for name in load(model.task).calibrated:
        (fitted,) = (parameter for parameter in kept.parameters if parameter.name == name)
        assert fitted.low < fitted.value < fitted.high
        assert f"{name}: {fitted.value:.3g}" in told


@pytest.mark.slow
def test_a_discovery_names_what_was_hidden(recordings: tuple[Path, ...], capsys: pytest.CaptureFixture[str]) -> None:
    case = example("03_discover").main(recordings)
    assert case.verdict == "named"
    assert [cause.effect for cause in case.causes] == ["tcp_offset"]
    (hidden,) = CASE.injected
    for found, truth in zip(case.causes[0].estimates, hidden.values, strict=True):
        assert found.value == pytest.approx(truth, abs=5e-4)
    told = capsys.readouterr().out
    assert case.sentences[0] in told
    assert re.search(r"\d\d% tcp_offset: tcp_x", told)


def test_a_task_of_ones_own_is_begun_planned_and_pushed_nearer_to_its_goal() -> None:
    module = example("04_task")
    played = module.main()
    assert played.failure == ""
    before_m2, after_m2 = played.chamfer_m2
    assert after_m2 < 0.5 * before_m2
    goal = load("rope_arc@rods").goal(0, 300)
    from_middle_m = np.linalg.norm(goal[:, :2] - [0.50, 0.0], axis=1)
    assert np.abs(from_middle_m - 0.40 / np.pi).max() < 0.009


def test_an_effect_of_ones_own_deflects_by_its_sign_and_vanishes_at_its_null() -> None:
    main = example("05_effect").main
    (still, turned), (_, unturned), (_, back) = (main(turn_rate) for turn_rate in (2.0, 0.0, -2.0))
    np.testing.assert_allclose(unturned, still, atol=1e-6)
    right, left = ((x - still)[:, 0].mean() for x in (turned, back))
    assert right > 1e-3
    assert left < -1e-3


@pytest.mark.slow
def test_a_policy_proposes_nearly_what_was_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = tuple(demonstration(tmp_path / f"{seed}.mcap", seed) for seed in (1, 2))
    proposed, demonstrated = example("06_policy").main(shown)
    assert np.linalg.norm(proposed - demonstrated, axis=1).max() < 0.06
    assert "bc has learnt 4 pushes of 2 recordings" in capsys.readouterr().out


def test_a_planner_of_ones_own_betters_every_branch_and_chooses_the_cheapest() -> None:
    plan = example("07_planner").main()
    costs = [(branch.cost_before, branch.cost_after) for branch in plan.branches if branch.finite]
    assert all(after <= before for before, after in costs)
    assert sum(after < before for before, after in costs) > len(costs) / 2
    assert plan.branches[plan.best].cost_after == min(after for _, after in costs) < 0
    assert plan.predicted_chamfer_m2 < plan.chamfer_m2


def test_a_planner_of_ones_own_simulates_as_much_as_the_tree_and_finds_a_minimum() -> None:
    planner, tree = example("07_planner").planner(search(), DESCENT, 6), tree_rollouts(search(), 6)
    assert tree <= simulated(planner) <= 1.1 * tree
    actions = jax.random.uniform(jax.random.key(1), (16, 2, 2), minval=-0.4, maxval=1.9)
    found = planner.optimise(bowl, actions, np.full(2, 0.4, np.float32))
    assert bool((found.best.masked_cost <= found.cost_before).all())
    assert float(found.best.masked_cost.min()) < 0.1 * float(found.cost_before.min())
