"""Task that a command line names: the sizes of its object, and the dynamics that simulate it."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from app.commands._named import full_name
from app.core.errors import UsageError
from app.jobs.worker_api import nominal_model
from app.recording.exchange.model_file import load_model, save_model
from app.recording.exchange.object_file import load_object

ROPE = "length_m = 0.3\nradius_m = 0.006\n"


def file(folder: Path, text: str) -> Path:
    path = folder / "rope.toml"
    path.write_text(text)
    return path


def sizes_of(folder: Path, text: str) -> Mapping[str, float]:
    return load_object(file(folder, text)).sizes


def test_a_rope_is_simulated_as_a_rod_where_nobody_says_otherwise():
    assert full_name("rope_push", dynamics=None) == "rope_push@rods"
    assert full_name("rope_push", dynamics="mpm") == "rope_push"
    assert full_name("bean_sweep", dynamics=None) == "bean_sweep"


def test_sizes_come_from_a_file_and_go_with_the_name(tmp_path: Path):
    name = full_name("rope_push", dynamics=None, sizes=sizes_of(tmp_path, ROPE))
    assert name == "rope_push(length_m=0.3,radius_m=0.006)@rods"


def test_a_model_says_what_it_is_of(tmp_path: Path):
    for task in ("rope_push", "rope_push@rods", "rope_push(radius_m=0.006)@rods"):
        save_model(tmp_path / "model.toml", nominal_model(task))
        assert full_name("rope_push", dynamics=None, model=tmp_path / "model.toml") == task


def test_hard_problems_go_with_the_name_sizes_dynamics_and_models(tmp_path: Path):
    assert full_name("rope_push", dynamics=None, problems="hard") == "rope_push-hard@rods"
    assert full_name("rope_push-hard", dynamics="mpm", problems="hard") == "rope_push-hard"
    assert full_name("rope_push-hard", dynamics=None, sizes=sizes_of(tmp_path, "length_m = 0.3")) == (
        "rope_push-hard(length_m=0.3)@rods"
    )
    assert full_name("rope_push", dynamics=None, problems="easy") == "rope_push@rods"
    path = tmp_path / "model.toml"
    save_model(path, nominal_model("rope_push(radius_m=0.006)@rods"))
    named = full_name("rope_push", dynamics=None, problems="hard", model=path)
    assert named == "rope_push-hard(radius_m=0.006)@rods"
    assert load_model(path, task=named, time_s=0.0).task == named
    with pytest.raises(UsageError, match="contradicts --problems easy"):
        full_name("rope_push-hard", dynamics=None, problems="easy")


def test_a_model_of_other_dynamics_is_refused_with_those_to_name(tmp_path: Path):
    save_model(tmp_path / "model.toml", nominal_model("rope_push"))
    for task in ("rope_push@rods", "rope_push-hard@rods"):
        with pytest.raises(UsageError, match="--dynamics mpm"):
            load_model(tmp_path / "model.toml", task=task, time_s=0.0)
    read = load_model(tmp_path / "model.toml", task="rope_push-hard@rods", time_s=0.0, whole=False)
    assert read.task == "rope_push-hard"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lenght_m = 0.3", "length_m"),
        ("length_m = true", "no number"),
        ("length_m", "no object"),
        ("x = 1", "Known"),
    ],
)
def test_a_file_that_says_no_sizes_is_refused(tmp_path: Path, text: str, said: str):
    with pytest.raises(UsageError, match=said):
        load_object(file(tmp_path, text))


def test_impossible_sizes_and_contradictions_are_refused(tmp_path: Path):
    with pytest.raises(UsageError, match="radius_m"):
        full_name("rope_push", dynamics=None, sizes=sizes_of(tmp_path, "radius_m = 0.1"))
    with pytest.raises(UsageError, match="leave --object out"):
        full_name("rod_to_rope", dynamics=None, sizes=sizes_of(tmp_path, ROPE))
    with pytest.raises(UsageError, match="Known: mass_kg, size_m"):
        full_name("cloth_hang", dynamics=None, sizes=sizes_of(tmp_path, ROPE))
    with pytest.raises(UsageError, match="Known: count, mass_kg"):
        full_name("bean_sweep", dynamics=None, sizes=sizes_of(tmp_path, ROPE))
    with pytest.raises(UsageError, match="contradicts"):
        full_name("rope_push@rods", dynamics="mpm")
    with pytest.raises(UsageError, match="Unknown dynamics"):
        full_name("bean_sweep", dynamics="rods")


def test_a_file_of_sizes_leaves_the_dynamics_and_other_sizes_as_they_are_named(tmp_path: Path):
    sizes = sizes_of(tmp_path, "length_m = 0.3")
    assert full_name("rope_push@mpm", dynamics=None, sizes=sizes) == "rope_push(length_m=0.3)"
    assert full_name("rope_push(radius_m=0.006)", dynamics=None, sizes=sizes) == (
        "rope_push(length_m=0.3,radius_m=0.006)@rods"
    )
    with pytest.raises(UsageError, match="contradicts"):
        full_name("rope_push@rods", dynamics="mpm", sizes=sizes)


def test_a_model_of_another_task_says_nothing_and_one_of_the_same_task_its_sizes(tmp_path: Path):
    save_model(tmp_path / "model.toml", nominal_model("rope_push(length_m=0.3)@rods"))
    assert full_name("bean_sweep", dynamics=None, model=tmp_path / "model.toml") == "bean_sweep"
    named = full_name("rope_push", dynamics="rods", model=tmp_path / "model.toml")
    assert named == "rope_push(length_m=0.3)@rods"
