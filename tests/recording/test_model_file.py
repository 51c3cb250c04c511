"""A model goes through its file unchanged; what is no model file is refused in one line."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.core.errors import RecordingError, UsageError
from app.core.messages import Extension, Model, Parameter
from app.recording.exchange.model_file import load_model, save_model
from app.recording.format.codec import decode, encode

MODEL = Model(
    id="model-1",
    time_s=0.0,
    version=3,
    task="rope_push",
    parameters=(Parameter(name="stiffness", value=3e4, unit="Pa", low=1e4, high=9e4),),
    loss_m2=1e-5,
    transition_count=4,
)

EXTENDED = replace(
    MODEL,
    apparatus=(Parameter(name="hand_eye_x", value=0.004, unit="m", low=0.003, high=0.005),),
    extension=Extension(
        effects=("hand_eye_translation",),
        camera_m=(0.55, -0.25, 0.95),
        estimated=("stiffness", "hand_eye_x"),
        covariance=((4e7, -1e-3), (-1e-3, 3.7e-7)),
        recordings={"episode-01.mcap": "ab" * 32},
    ),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    save_model(tmp_path / "model.toml", MODEL)
    return tmp_path / "model.toml"


def test_a_model_comes_back_as_it_was(path: Path):
    model = load_model(path, task="rope_push", time_s=1.0)
    assert (model.version, model.parameters, model.loss_m2) == (MODEL.version, MODEL.parameters, MODEL.loss_m2)


@pytest.mark.parametrize("lost", ["schema = 2", "version = 3", "value = 30000.0", "loss_m2 = 1e-05"])
def test_a_file_that_lacks_something_is_no_model_file(lost: str, path: Path):
    text = path.read_text()
    assert lost in text
    path.write_text(text.replace(lost, ""))
    with pytest.raises(RecordingError, match="is not a model file"):
        load_model(path, task="rope_push", time_s=0.0)


@pytest.mark.parametrize(
    ("sound", "broken", "says"),
    [
        ("value = 30000.0", "", r"\[parameters.stiffness\] lacks 'value'"),
        ("value = 30000.0", 'value = "soft"', r"\[parameters.stiffness\] value"),
        ("version = 3", "", "it lacks 'version'"),
        ("version = 3", "version = = 3", "line 3"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_by_its_place(sound: str, broken: str, says: str, path: Path):
    path.write_text(path.read_text().replace(sound, broken))
    with pytest.raises(RecordingError, match=rf"{path.name} is not a model file \(.*{says}"):
        load_model(path, task="rope_push", time_s=0.0)


def test_a_file_of_another_schema_is_refused_whatever_else_it_holds(path: Path):
    path.write_text("schema = 3")
    with pytest.raises(RecordingError, match="schema 3; this version reads schema 1 and 2"):
        load_model(path, task="rope_push", time_s=0.0)


def test_a_file_of_schema_1_is_still_a_model(path: Path):
    path.write_text(path.read_text().replace("schema = 2", "schema = 1"))
    model = load_model(path, task="rope_push", time_s=0.0)
    assert (model.parameters, model.apparatus, model.extension) == (MODEL.parameters, (), Extension())


def test_an_extended_model_comes_back_as_it_was_read_from_a_recording_or_not(tmp_path: Path):
    for written in (EXTENDED, decode(encode(EXTENDED, Model), Model)):
        save_model(tmp_path / "extended.toml", written)
        read = load_model(tmp_path / "extended.toml", task="rope_push", time_s=0.0)
        assert (read.apparatus, read.extension) == (EXTENDED.apparatus, EXTENDED.extension)


@pytest.mark.parametrize(
    ("sound", "broken", "says"),
    [
        ("camera_m = [\n    0.55,", "camera_m = [", "camera_m must be x, y, z"),
        ('estimated = [\n    "stiffness",', "estimated = [", "a row and a column for each of 1"),
        ("[extension.recordings]", "[extension.notes]", "recordings"),
        ("[apparatus.hand_eye_x]\nvalue = 0.004", "[apparatus.hand_eye_x]", "value"),
    ],
)
def test_what_is_wrong_with_an_extension_is_said(sound: str, broken: str, says: str, tmp_path: Path):
    path = tmp_path / "extended.toml"
    save_model(path, EXTENDED)
    text = path.read_text()
    assert sound in text
    path.write_text(text.replace(sound, broken))
    with pytest.raises(RecordingError, match=f"is not a model file .*{says}"):
        load_model(path, task="rope_push", time_s=0.0)


def test_a_model_of_another_task_is_refused(path: Path):
    with pytest.raises(UsageError, match="rope_push"):
        load_model(path, task="cloth_fold", time_s=0.0)
