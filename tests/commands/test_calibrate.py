"""`dipac calibrate` counts each recording once, as `dipac train` does."""

import shutil
from pathlib import Path

import pytest

from app.commands.calibrate import calibrate
from app.core.errors import UsageError
from app.jobs.worker_api import nominal_model
from app.recording.exchange.model_file import load_model, save_model
from app.sim.model.params import index
from app.tasks import load
from tests.commands.test_train import demonstration


@pytest.mark.parametrize("link", [True, False])
def test_the_same_recording_under_two_names_is_refused(link: bool, tmp_path: Path) -> None:
    first, second = demonstration(tmp_path / "a.mcap", 0), tmp_path / "b.mcap"
    if link:
        second.symlink_to(first)
    else:
        shutil.copy(first, second)
    with pytest.raises(UsageError, match=r"same content \(a.mcap, b.mcap\) count once"):
        calibrate((first, second), output=tmp_path / "model.toml")


def test_the_same_path_twice_counts_once(tmp_path: Path) -> None:
    path = demonstration(tmp_path / "a.mcap", 0, task="rope_push@rods")
    calibrate((path, path), output=tmp_path / "model.toml")
    model = load_model(tmp_path / "model.toml", task="rope_push@rods", time_s=0.0)
    assert model.transition_count == 2
    of = {parameter.name: parameter for parameter in model.parameters}
    # Two pushes do not tell five numbers.
    spec = load("rope_push@rods").parameters()[index("stiffness")]
    assert (of["stiffness"].low, of["stiffness"].high) == pytest.approx((spec.low, spec.high))


def test_notes_on_parameters_are_in_the_file_and_do_not_hinder_reading_it(tmp_path: Path) -> None:
    model = nominal_model("rope_push@rods")
    save_model(tmp_path / "m.toml", model, notes={"stiffness": "at the high end of its range"})
    assert "at the high end" in (tmp_path / "m.toml").read_text()
    assert load_model(tmp_path / "m.toml", task="rope_push@rods", time_s=0.0).parameters == model.parameters
