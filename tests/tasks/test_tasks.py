"""Tasks as the application uses them: jobs that cross pipes, and learning."""

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from app import tasks
from app.core.errors import UsageError
from app.core.messages import Transition
from app.jobs.worker_api import calibrate, nominal_model, plan, update, warm_up_stage, warm_up_stages
from app.tasks import load, names
from bench.table import Table


def test_an_unknown_task_or_preset_names_the_known_ones() -> None:
    with pytest.raises(UsageError, match="Did you mean 'rope_push'"):
        load("rope_pusch")
    with pytest.raises(UsageError, match="Known: cpu, gpu"):
        load("rope_push").preset("tpu")


FILE = Path(tasks.__file__).parent / "rope_push.py"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("        success=Near(limit_m2=2 * 0.012**2),\n", ""), "argument: 'success'"),
        (("    horizon=30,", "    horizons=30,"), "argument"),
        (("    horizon=30,", "    horizon=0,"), "horizon = 0 is outside its range 1 to 1000"),
        (('"stiffness": 6.0e4', '"stiffness": -1.0'), "nominal stiffness = -1 is outside its range"),
        (('"stiffness": 6.0e4', '"stifness": 6.0e4'), "Unknown parameter 'stifness'. Did you mean 'stiffness'"),
        (('calibrated=("stiffness"', 'calibrated=("softness"'), "Unknown parameter 'softness'"),
        (("branches=8,", "branches=0,"), "presets['cpu'].branches = 0 is outside its range"),
        (
            ("branches=8,", "branches=8, policy_shares=(0.5, 1.5),"),
            "policy_shares = 1.5 is outside its range 0.001 to 1",
        ),
        (
            ("branches=8,", "branches=8, policy_shares=(0.5,),"),
            "number of policy_shares = 1 is outside its range 0 to 0",
        ),
        (('name="rope_push"', 'name="rope_pull"'), "defines a task of the name 'rope_pull'"),
    ],
)
def test_a_task_file_that_is_wrong_is_refused_with_file_field_and_value(
    change: tuple[str, str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setattr(tasks, "__path__", [str(tmp_path)])
    for name in ("rope_push", "other"):
        text = FILE.read_text()
        (tmp_path / f"{name}.py").write_text(text.replace(*change) if name == "rope_push" else text)
        assert text.count(change[0]) == 1
    monkeypatch.delitem(sys.modules, "app.tasks.rope_push", raising=False)
    names.cache_clear()
    try:
        with pytest.raises(UsageError) as refusal:
            load("rope_push")
    finally:
        names.cache_clear()
    assert str(tmp_path / "rope_push.py") in str(refusal.value)
    assert said in str(refusal.value)


def test_a_program_adds_a_task_under_a_name_that_no_other_has() -> None:
    own = replace(load("rope_push"), name="rope_of_a_program", sized=None)
    assert tasks.add(own) is tasks.add(own) is load("rope_of_a_program")
    assert load("rope_of_a_program@rods").dynamics == "rods"
    assert "rope_of_a_program" not in names()
    for name in ("rope_of_a_program", "rope_push"):
        with pytest.raises(UsageError, match=f"There is a task {name} already"):
            tasks.add(replace(own, name=name, horizon=7))
    with pytest.raises(UsageError, match="add the task without them, as rope_of_a_program"):
        tasks.add(load("rope_of_a_program@rods"))


@pytest.mark.serial
def test_naming_a_rope_loads_neither_jax_nor_warp() -> None:
    code = "import sys, app.tasks.elements.base; print([m for m in ('jax', 'warp') if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("function", [plan, calibrate, update, warm_up_stage])
def test_what_workers_run_crosses_a_pipe(function: object) -> None:
    assert pickle.loads(pickle.dumps(function)) is function


def test_what_learns_elsewhere_is_not_waited_for() -> None:
    planning, both = (warm_up_stages("rope_push", "cpu", learning=learning) for learning in (False, True))
    assert both[: len(planning)] == planning
    assert len(both) == len(planning) + 1


@pytest.mark.slow
def test_a_warmed_up_task_plans_pushes_and_learns_from_the_push() -> None:
    task = load("rope_push")
    stages = warm_up_stages("rope_push", "cpu", learning=True)
    for index in range(len(stages)):
        warm_up_stage("rope_push", "cpu", index, learning=True)
    assert all(stages)
    table, model = Table(task, 0, 300), nominal_model("rope_push")
    x = table.observe()
    found = plan("rope_push", "cpu", x, task.goal(0, 300), model, 0)
    seen = [table.push(found.motion, x)]
    learnt = update("rope_push", "cpu", seen, model)
    assert learnt.version == 1
    assert learnt.transition_count == 1
    assert model.id in learnt.cause
    assert seen[0].id in learnt.cause
    assert pickle.loads(pickle.dumps(found)).motion.digest() == found.motion.digest()


def test_learning_from_nothing_is_refused() -> None:
    with pytest.raises(UsageError, match="No transitions"):
        calibrate("rope_push", "cpu", list[Transition](), nominal_model("rope_push"))


def test_a_preset_sizes_what_is_seen() -> None:
    task = load("rope_push")
    smaller = replace(task, presets={**task.presets, "cpu": replace(task.preset("cpu"), particle_count=123)})
    assert smaller.reconstruction("cpu").particle_count == 123
