"""A folder of recordings says what each file is, whatever befell it, and what may go."""

import fcntl
import json
import os
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from app.core.errors import UsageError
from app.core.messages import Episode
from app.recording.format import digests
from app.recording.format.clock_offset import Epoch
from app.recording.format.lock import hold, is_being_written
from app.recording.library.label import Label, relabel
from app.recording.library.prune import Rule, discard, prunable
from app.recording.library.recording_index import entry, shelf
from app.recording.write.file import EpisodeFile
from tests.recording.demonstrations import PUSHES, demonstration
from tests.recording.samples import Maker

DAY_S = 86400.0


def test_a_whole_one_says_what_it_is_of_and_how_much(tmp_path: Path) -> None:
    before = datetime.now(UTC)
    path = demonstration(tmp_path, seed=4)
    relabel(path, Label.now("success", note="well", operator="me"))
    found = entry(path)
    assert (found.condition, found.task, found.pushes, found.faults) == ("whole", "rope_push", PUSHES, 1)
    assert (found.said, found.demonstration, found.metadata["seed"]) == ("success", True, "4")
    assert found.size_bytes == path.stat().st_size
    assert found.began is not None
    assert 0 <= (found.began - before).total_seconds() + 1 < 60
    assert found.counts["/dipac/frame"] == 2 * (PUSHES + 1)
    row = json.loads(json.dumps(found.row()))
    assert (row["label"], row["note"], row["pushes"]) == ("success", "well", PUSHES)


def test_a_label_that_was_taken_back_is_none(tmp_path: Path) -> None:
    path = demonstration(tmp_path)
    for said in ("failure", "unlabelled"):
        relabel(path, Label.now(said, note="", operator=""))
    assert entry(path).said == ""


def test_one_that_is_being_written_one_that_was_cut_off_and_what_is_none_of_ours(tmp_path: Path) -> None:
    whole = demonstration(tmp_path, seed=1)
    cut, foreign, empty = (tmp_path / f"{name}.mcap" for name in ("cut", "foreign", "empty"))
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    foreign.write_bytes(b"something else")
    empty.touch()
    writing = EpisodeFile(tmp_path / "now.mcap", Maker(seed=0)(Episode, task="bean_sweep"))
    try:
        found = {it.path.name: it for it in shelf([tmp_path])}
        assert found["now.mcap"].condition == "recording"
        assert found["now.mcap"].task == "bean_sweep"
    finally:
        writing.close()
    assert found[whole.name].condition == "whole"
    assert (found["cut.mcap"].condition, found["cut.mcap"].task) == ("cut off", "rope_push")
    assert "dipac recordings recover" in found["cut.mcap"].why
    assert found["cut.mcap"].began == pytest.approx(
        found[whole.name].began, abs=__import__("datetime").timedelta(seconds=2)
    )
    for name in ("foreign.mcap", "empty.mcap"):
        assert (found[name].condition, found[name].pushes) == ("unreadable", 0)
        assert "not an MCAP file" in found[name].why
    assert entry(tmp_path / "now.mcap").condition == "whole"


def test_a_place_that_is_not_there_names_those_that_are(tmp_path: Path) -> None:
    path = demonstration(tmp_path)
    with pytest.raises(UsageError, match=path.name):
        shelf([tmp_path / "none.mcap"])


def test_folders_are_searched_through_and_named_files_come_once(tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    path = demonstration(inner)
    assert [it.path for it in shelf([tmp_path, path])] == [path]


def test_the_oldest_go_first_and_only_what_nobody_wants_to_keep(tmp_path: Path) -> None:
    plain = [demonstration(tmp_path / str(n), seed=n, config="{}") for n in range(3)]
    shown, labelled = demonstration(tmp_path / "shown"), demonstration(tmp_path / "labelled", config="{}")
    relabel(labelled, Label.now("failure", note="", operator=""))
    entries = shelf([tmp_path])
    sizes = {it.path: it.size_bytes for it in entries}
    total = sum(sizes.values())

    def gone(**rule: object) -> list[Path]:
        return [it.path for it in prunable(entries, Rule(**rule))]  # pyright: ignore[reportArgumentType]

    assert gone() == []
    assert gone(keep_bytes=total) == []
    assert gone(keep_bytes=total - 1) == plain[:1]
    assert gone(keep_bytes=total - sizes[plain[0]] - 1) == plain[:2]
    assert gone(keep_bytes=0) == plain
    assert set(gone(keep_bytes=0, all_kinds=True)) == {*plain, shown, labelled}
    assert gone(days=1.0) == []
    later = [it.path for it in prunable(entries, Rule(days=1.0), now_s=time.time() + 1.1 * DAY_S)]
    assert later == plain


def test_one_that_is_being_written_never_goes(tmp_path: Path) -> None:
    writing = EpisodeFile(tmp_path / "now.mcap", Maker(seed=0)(Episode))
    try:
        assert prunable(shelf([tmp_path]), Rule(keep_bytes=0, all_kinds=True)) == []
    finally:
        writing.close()


def test_what_goes_takes_its_checksum_along(tmp_path: Path) -> None:
    kept, gone = demonstration(tmp_path, seed=1), demonstration(tmp_path, seed=2)
    discard(gone)
    assert not gone.exists()
    assert digests.stored_digest(gone) is None
    assert digests.stored_digest(kept) == digests.digest(kept)


def test_a_file_is_there_once_however_it_is_named_and_links_and_folders_are_none(tmp_path: Path) -> None:
    path = demonstration(tmp_path / "a")
    (tmp_path / "a" / "link.mcap").symlink_to(path)
    (tmp_path / "a" / "lost.mcap").symlink_to(tmp_path / "nowhere.mcap")
    (tmp_path / "a" / "folder.mcap").mkdir()
    (tmp_path / "b").mkdir()
    assert [it.path for it in shelf([tmp_path / "a", tmp_path / "b" / ".." / "a", path])] == [path]


def test_a_recording_is_locked_although_somebody_was_just_looking(tmp_path: Path) -> None:
    path = tmp_path / "now.mcap"
    path.touch()
    looking = os.open(path, os.O_RDONLY)
    fcntl.flock(looking, fcntl.LOCK_SH)
    threading.Timer(0.2, os.close, (looking,)).start()
    writing = hold(path)
    assert is_being_written(path)
    os.close(writing)
    assert not is_being_written(path)


def test_what_was_cut_off_just_now_may_still_be_written_where_there_are_no_locks(tmp_path: Path) -> None:
    whole = demonstration(tmp_path, config="{}")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-60])
    rule = Rule(keep_bytes=0)
    assert [it.path for it in prunable(shelf([tmp_path]), rule)] == [whole]
    later = prunable(shelf([tmp_path]), rule, now_s=time.time() + 3600)
    assert {it.path for it in later} == {whole, cut}


def test_data_with_a_clock_of_its_own_are_as_old_as_their_file(tmp_path: Path) -> None:
    path = tmp_path / "imported.mcap"
    episode = Maker(seed=0)(Episode, config="{}", time_s=0.0)
    file = EpisodeFile(path, episode, epoch=Epoch(offset_ns=0))
    file.write(episode, now_s=0.0)
    file.close()
    found = entry(path)
    assert found.began is not None
    assert found.began.year == 1970
    assert prunable([found], Rule(days=1.0)) == []


def test_sums_that_others_wrote_are_kept_and_understood(tmp_path: Path) -> None:
    path = demonstration(tmp_path)
    sums = tmp_path / digests.SUMS
    foreign = b"# mine\n" + b"0" * 64 + b"  a \xff b.bin\n"
    sums.write_bytes(foreign + f"{'1' * 64}  ./{path.name}\n".encode())
    assert digests.stored_digest(path) == "1" * 64
    digests.note(path)
    assert digests.stored_digest(path) == digests.digest(path)
    assert all(line in sums.read_bytes() for line in foreign.splitlines())
