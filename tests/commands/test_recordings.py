"""`dipac recordings`: what is listed, shown, checked, labelled, exported and deleted, as a user types it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from app.__main__ import main
from app.core.errors import PreflightError, RecordingError, UsageError
from app.recording.format import digests
from app.recording.library.label import labels
from app.recording.library.recover import recover
from app.recording.write.preflight import Room, check_folder
from tests.recording.demonstrations import PARTICLES, PUSHES, demonstration


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two whole recordings, one of them no demonstration, and one that was cut off."""
    for seed, config in enumerate(("{}", '{"expert": true}')):
        demonstration(tmp_path / "recs", seed=seed, config=config)
    first = min((tmp_path / "recs").glob("*.mcap"))
    (tmp_path / "recs" / "cut.mcap").write_bytes(first.read_bytes()[:-40])
    return tmp_path / "recs"


def paths(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*.mcap") if path.name != "cut.mcap")


def said(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main(["recordings", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], code: int, *arguments: object) -> str:
    assert main(["recordings", *map(str, arguments)]) == code
    return capsys.readouterr().err


def test_a_list_names_every_file_whole_however_narrow_the_terminal(folder: Path, capsys) -> None:
    listed = said(capsys, "list", folder)
    for path in folder.glob("*.mcap"):
        assert str(path) in listed
    assert "3 recordings" in listed
    assert "cut off" in listed
    rows = json.loads(said(capsys, "list", folder, "--json"))
    assert [row["condition"] for row in rows] == ["whole", "cut off", "whole"]
    assert [row["demonstration"] for row in rows] == [False, False, True]


def test_an_empty_folder_says_what_fills_it(tmp_path: Path, capsys) -> None:
    assert "dipac run" in said(capsys, "list", tmp_path)


def test_a_closer_look_has_pushes_words_and_labels(folder: Path, capsys) -> None:
    path = paths(folder)[0]
    said(capsys, "label", "failure", path, "--note", "it [slipped]", "--operator", "me")
    shown = said(capsys, "show", path)
    for expected in ("rope_push", "/dipac/outcome", "All is [well].", "It was late.", "failure (me) it [slipped]"):
        assert expected in shown
    assert digests.digest(path) in shown
    assert "cut off" in refused(capsys, RecordingError.exit_code, "show", folder / "cut.mcap")


def test_a_check_ends_with_an_error_where_something_is_lost(folder: Path, capsys) -> None:
    assert main(["recordings", "check", str(folder)]) == RecordingError.exit_code
    captured = capsys.readouterr()
    assert "2 of 3 recordings are good" in captured.out
    assert f"bad  {folder / 'cut.mcap'}" in captured.out
    assert captured.err.count("\n") == 1
    (folder / "cut.mcap").unlink()
    assert "2 of 2 recordings are good" in said(capsys, "check", folder)


def test_a_check_notes_the_checksums_that_are_missing(folder: Path, capsys) -> None:
    (folder / digests.SUMS).unlink()
    said(capsys, "check", *paths(folder), "--note")
    assert all(digests.stored_digest(path) == digests.digest(path) for path in paths(folder))


def test_a_label_keeps_the_checksum_right_and_never_hides_that_it_was_wrong(folder: Path, capsys) -> None:
    good, bad = paths(folder)
    sums = folder / digests.SUMS
    sums.write_text(sums.read_text().replace(digests.digest(bad), "0" * 64))
    said(capsys, "label", "success", good, bad)
    assert [label.said for label in labels(good)] == ["success"]
    assert digests.stored_digest(good) == digests.digest(good)
    assert digests.stored_digest(bad) == "0" * 64


def test_nothing_is_labelled_where_one_of_many_cannot_be(folder: Path, capsys) -> None:
    assert "nothing was labelled" in refused(capsys, RecordingError.exit_code, "label", "success", folder)
    assert all(labels(path) == [] for path in paths(folder))


def test_a_file_that_is_damaged_gets_no_checksum_by_a_label(folder: Path, capsys) -> None:
    path = paths(folder)[0]
    (folder / digests.SUMS).unlink()
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    said(capsys, "label", "success", path)
    assert digests.stored_digest(path) is None


def test_an_unknown_label_names_the_known_ones(folder: Path, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["recordings", "label", "splendid", str(paths(folder)[0])])
    assert ended.value.code == UsageError.exit_code
    assert "success" in capsys.readouterr().err


def test_what_was_cut_off_is_recovered_with_a_checksum(folder: Path, capsys) -> None:
    assert "cut.recovered.mcap" in said(capsys, "recover", folder / "cut.mcap")
    made = folder / "cut.recovered.mcap"
    assert recover(made).was_whole
    assert digests.stored_digest(made) == digests.digest(made)


@pytest.mark.parametrize("to", ["npz", "ply"])
def test_whole_recordings_leave_for_other_programs_and_the_others_are_named(
    folder: Path, tmp_path: Path, capsys, to: str
) -> None:
    out = tmp_path / "out"
    told = said(capsys, "export", folder, "--to", to, "-o", out)
    assert "Left out: " in told
    assert "cut.mcap is cut off" in told
    stems = {path.stem for path in paths(folder)}
    assert {path.stem for path in out.iterdir()} == stems
    if to == "npz":
        with np.load(out / f"{min(stems)}.npz") as arrays:
            assert len(arrays["cloud_offsets"]) == 2 * PUSHES + 1
    refused(capsys, UsageError.exit_code, "export", folder, "--to", to, "-o", out)


@pytest.mark.parametrize("task", ["pour_soup", "pour_water", "rope_push"])
def test_arrays_of_pours_are_the_liquid_in_its_bowls_and_not_the_surface_that_is_seen(
    tmp_path: Path, capsys, task: str
) -> None:
    demonstration(tmp_path / task, task=task, particles=PARTICLES)
    said(capsys, "export", tmp_path / task, "--to", "npz", "-o", tmp_path / "out")
    (file,) = (tmp_path / "out").iterdir()
    with np.load(file) as arrays:
        sizes = set(np.diff(arrays["cloud_offsets"]).tolist())
    assert (sizes == {PARTICLES}) == task.startswith("pour")


def test_recordings_of_the_same_name_get_files_of_their_own(tmp_path: Path, capsys) -> None:
    for name in ("a", "b"):
        demonstration(tmp_path / name).rename(tmp_path / name / "x.mcap")
    said(capsys, "export", tmp_path / "a", tmp_path / "b", "--to", "npz", "-o", tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["x-2.npz", "x.npz"]


def middle_of_largest_chunk(path: Path) -> int:
    """Offset of a byte of messages: the indexes between chunks have no checksum, and are not needed."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    largest = max(summary.chunk_indexes, key=lambda chunk: chunk.chunk_length)
    return largest.chunk_start_offset + largest.chunk_length // 2


def test_a_damaged_one_is_left_out_by_name_and_an_export_that_fails_leaves_nothing(
    folder: Path, tmp_path: Path, capsys
) -> None:
    good, bad = paths(folder)
    data = bytearray(bad.read_bytes())
    data[middle_of_largest_chunk(bad)] ^= 1
    bad.write_bytes(data)
    told = said(capsys, "export", folder, "--to", "npz", "-o", tmp_path / "out")
    assert f"{bad} is left out" in told
    assert [path.stem for path in (tmp_path / "out").iterdir()] == [good.stem]
    refused(capsys, RecordingError.exit_code, "export", bad, "--to", "npz", "-o", tmp_path / "none")
    assert [path.name for path in tmp_path.iterdir() if "none" in path.name] == []


def test_a_dataset_of_what_succeeded(folder: Path, tmp_path: Path, capsys) -> None:
    pytest.importorskip("datasets", reason="The package `datasets` is missing; install dipac[lerobot].")
    out = tmp_path / "dataset"
    error = refused(
        capsys, UsageError.exit_code, "export", folder, "--to", "lerobot", "-o", out, "--labelled", "success"
    )
    assert "no whole recording labelled success" in error
    said(capsys, "label", "success", paths(folder)[1])
    chosen = ("export", folder, "--to", "lerobot", "--labelled", "success", "--fps", 20)
    assert "1 episodes, 60 steps at 20 a second" in said(capsys, *chosen, "--rest", 0, "-o", out)
    # Half a second after each of three motions.
    assert "1 episodes, 90 steps at 20 a second" in said(capsys, *chosen, "-o", tmp_path / "rested")
    assert json.loads((out / "meta" / "info.json").read_text())["fps"] == 20


def test_nothing_goes_without_a_yes(folder: Path, capsys) -> None:
    plain, shown = paths(folder)
    told = said(capsys, "prune", folder, "--keep-gb", 0)
    assert f"would delete  {plain}" in told
    assert str(shown) not in told
    assert plain.exists()
    said(capsys, "prune", folder, "--keep-gb", 0, "--yes")
    assert not plain.exists()
    assert shown.exists()
    assert "too much" in refused(capsys, UsageError.exit_code, "prune", folder)
    for wrong in ("-1", "inf", "nan"):
        assert "not negative" in refused(capsys, UsageError.exit_code, "prune", folder, "--days", wrong)


def test_an_episode_that_may_not_fit_is_refused_before_it_begins(folder: Path) -> None:
    taken = sum(path.stat().st_size for path in folder.glob("*.mcap"))
    check_folder(folder, Room(expected_bytes=1000, budget_bytes=taken + 1000))
    with pytest.raises(PreflightError, match=r"dipac recordings prune .*--budget-gb"):
        check_folder(folder, Room(expected_bytes=1001, budget_bytes=taken + 1000))
    with pytest.raises(PreflightError, match="an episode wants"):
        check_folder(folder, Room(expected_bytes=1 << 60))


@pytest.mark.serial
def test_the_program_refuses_where_its_budget_is_used_up(folder: Path) -> None:
    command = [sys.executable, "-m", "app", "run", "rope_push", "--recordings", str(folder), "--budget-gb", "0.001"]
    ended = subprocess.run([*command, "--port", "0", "--preset", "cpu"], capture_output=True, text=True, timeout=120)
    assert ended.returncode == PreflightError.exit_code
    assert "raise --budget-gb" in ended.stderr
    assert ended.stderr.strip().count("\n") == 0
