"""Model files that a browser may name, and the answers about all others."""

import os
from pathlib import Path

import pytest

from app.core.errors import RecordingError, UsageError
from app.recording.exchange.model_file import save_model
from app.ui.tabs.model_files import read_model
from tests.ui import synthetic


def test_a_model_within_the_folder_is_read(tmp_path: Path):
    (tmp_path / "discovery").mkdir()
    save_model(tmp_path / "discovery" / "model.toml", synthetic.model(4, 3e-5))
    model = read_model(" discovery/model.toml ", tmp_path, task="rope_push", time_s=7.0)
    assert (model.version, model.time_s) == (4, 7.0)
    assert model.parameters == synthetic.model(4, 3e-5).parameters


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ("missing.toml", "no model of this folder"),
        ("notes.txt", "no model of this folder"),
        ("../outside.toml", "no model of this folder"),
        ("/etc/passwd", "no model of this folder"),
        ("link.toml", "no model of this folder"),
        ("", "no model of this folder"),
        ("folder.toml", "no model of this folder"),
        ("pipe.toml", "no model of this folder"),
        ("large.toml", "too large"),
        ("loop.toml", "no model of this folder"),
        (f"{'long' * 200}.toml", "no model of this folder"),
        ("of\0nothing.toml", "no model of this folder"),
    ],
)
def test_no_other_file_is_opened(tmp_path: Path, named: str, said: str):
    folder = tmp_path / "inside"
    (folder / "folder.toml").mkdir(parents=True)
    (folder / "notes.txt").write_text("schema = 2")
    (tmp_path / "outside.toml").write_text("schema = 2")
    (folder / "link.toml").symlink_to(tmp_path / "outside.toml")
    (folder / "large.toml").write_bytes(b"#" * 1_000_001)
    (folder / "loop.toml").symlink_to("loop.toml")
    os.mkfifo(folder / "pipe.toml")
    with pytest.raises(UsageError, match=said):
        read_model(named, folder, task="rope_push", time_s=0.0)


def test_what_is_no_model_or_of_another_task_is_said(tmp_path: Path):
    (tmp_path / "bad.toml").write_text("schema = 2\n")
    with pytest.raises(RecordingError, match="not a model file"):
        read_model("bad.toml", tmp_path, task="rope_push", time_s=0.0)
    save_model(tmp_path / "rope.toml", synthetic.model(4, 3e-5))
    with pytest.raises(UsageError, match="of task 'rope_push', not of 'bean_sweep'"):
        read_model("rope.toml", tmp_path, task="bean_sweep", time_s=0.0)
