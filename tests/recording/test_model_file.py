"""A model goes through its file unchanged; what is no model file is refused in one line."""

from pathlib import Path

import pytest

from app.core.errors import RecordingError, UsageError
from app.core.messages import Model, Parameter
from app.recording.model_file import load_model, save_model

MODEL = Model(
    id="model-1",
    time_s=0.0,
    version=3,
    task="rope_push",
    parameters=(Parameter(name="stiffness", value=3e4, unit="Pa", low=1e4, high=9e4),),
    loss_m2=1e-5,
    transition_count=4,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    save_model(tmp_path / "model.toml", MODEL)
    return tmp_path / "model.toml"


def test_a_model_comes_back_as_it_was(path: Path):
    model = load_model(path, task="rope_push", time_s=1.0)
    assert (model.version, model.parameters, model.loss_m2) == (MODEL.version, MODEL.parameters, MODEL.loss_m2)


@pytest.mark.parametrize("lost", ["schema = 1", "version = 3", "value = 30000.0", "loss_m2 = 1e-05"])
def test_a_file_that_lacks_something_is_no_model_file(lost: str, path: Path):
    text = path.read_text()
    assert lost in text
    path.write_text(text.replace(lost, ""))
    with pytest.raises(RecordingError, match="is not a model file"):
        load_model(path, task="rope_push", time_s=0.0)


def test_a_file_of_another_schema_is_refused_whatever_else_it_holds(path: Path):
    path.write_text("schema = 2")
    with pytest.raises(RecordingError, match="schema 2; this version reads schema 1"):
        load_model(path, task="rope_push", time_s=0.0)


def test_a_model_of_another_task_is_refused(path: Path):
    with pytest.raises(UsageError, match="rope_push"):
        load_model(path, task="cloth_fold", time_s=0.0)
