"""Commands write where a path leads to, and refuse paths that nobody means."""

from pathlib import Path

import pytest

from app.__main__ import main
from app.commands._preflight import check_writable
from app.core.errors import UsageError
from app.core.messages import Extension, Model, Parameter, fresh_id
from app.recording.exchange.calibration_file import load_cameras, save_camera
from app.recording.exchange.model_file import load_model, save_model
from app.recording.library.recording_index import entry
from tests.plain_data import plain_arrays, saved
from tests.recording.test_calibration_file import camera

MODEL = Model(
    id=fresh_id("model"),
    time_s=0.0,
    task="rope_push",
    version=1,
    parameters=(Parameter(name="stiffness", value=1.0, unit="Pa", low=1.0, high=1.0),),
    loss_m2=0.0,
    transition_count=1,
    extension=Extension(),
)


def linked(folder: Path, name: str) -> tuple[Path, Path]:
    """A link, and the file in a shared folder that it leads to."""
    (folder / "shared").mkdir()
    link = folder / name
    link.symlink_to(Path("shared", name))
    return link, folder / "shared" / name


def test_a_linked_model_and_calibration_are_written_where_they_are_shared(tmp_path: Path) -> None:
    link, real = linked(tmp_path, "model.toml")
    real.write_text("")
    save_model(link, MODEL)
    assert link.is_symlink()
    assert load_model(real, task="rope_push", time_s=0.0).version == 1
    place, shared = tmp_path / "calibration.toml", tmp_path / "shared" / "calibration.toml"
    place.symlink_to("shared/calibration.toml")
    save_camera(place, camera())
    assert place.is_symlink()
    assert load_cameras(shared)


def test_a_check_of_a_link_leaves_it_and_makes_no_file(tmp_path: Path) -> None:
    link, real = linked(tmp_path, "a.toml")
    check_writable(link, "-o")
    assert link.is_symlink()
    assert not real.exists()


def test_an_import_through_a_link_goes_where_it_leads(tmp_path: Path) -> None:
    link, real = linked(tmp_path, "a.mcap")
    assert main(["import", str(saved(tmp_path, plain_arrays())), "-o", str(link)]) == 0
    assert link.is_symlink()
    assert entry(real).condition == "whole"
    (tmp_path / "out").symlink_to("shared")
    (tmp_path / "empty").mkdir()
    (tmp_path / "folder").symlink_to("empty")
    assert main(["recordings", "export", str(link), "--to", "npz", "-o", str(tmp_path / "folder")]) == 0
    assert (tmp_path / "folder").is_symlink()
    assert len(list((tmp_path / "empty").glob("*.npz"))) == 1


@pytest.mark.parametrize("name", ["-", "out", "out.npz"])
def test_an_import_is_called_as_recordings_are(name: str, tmp_path: Path, monkeypatch, capsys) -> None:
    file = saved(tmp_path, plain_arrays())
    monkeypatch.chdir(tmp_path)
    assert main(["import", str(file), "-o", name]) == UsageError.exit_code
    assert ".mcap" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_an_import_takes_the_longest_name(tmp_path: Path) -> None:
    output = tmp_path / f"{'a' * 250}.mcap"
    assert main(["import", str(saved(tmp_path, plain_arrays())), "-o", str(output)]) == 0
    assert main(["recordings", "label", "success", str(output)]) == 0


@pytest.mark.parametrize("words", [["run", "--recordings", ""], ["recordings", "list", ""], ["recover", ""]])
def test_an_empty_path_is_refused(words: list[str], tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == UsageError.exit_code
    assert list(tmp_path.iterdir()) == []


def test_a_path_may_begin_at_home(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["recordings", "show", "~/none.mcap"]) == UsageError.exit_code
    assert str(tmp_path / "none.mcap") in capsys.readouterr().err
