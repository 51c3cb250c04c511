"""Clouds leave a recording as they are in it, in files that other programs read."""

from pathlib import Path

import numpy as np
import pytest

from app.commands.import_ import import_
from app.core.errors import RecordingError
from app.core.messages import Episode, Particles
from app.core.system.shared_libraries import load_open3d
from app.recording.exchange.npz_import import read_plain
from app.recording.read.clouds import write_npz, write_ply
from app.recording.read.reader import read_messages, read_transitions
from tests.plain_data import EPISODES, PUSHES, plain_arrays, saved
from tests.recording.demonstrations import PUSHES as SHOWN
from tests.recording.demonstrations import demonstration
from tests.recording.samples import Maker, record


@pytest.mark.parametrize("what", ["surface", "particles"])
def test_ply_files_hold_each_cloud_and_open3d_reads_them(tmp_path: Path, what: str) -> None:
    path = demonstration(tmp_path)
    assert write_ply(path, tmp_path / "ply", what) == SHOWN + 1  # pyright: ignore[reportArgumentType]
    files = sorted((tmp_path / "ply").iterdir())
    assert [file.name for file in files][:2] == ["00000-0000.000s.ply", "00001-0003.000s.ply"]
    for file, seen in zip(files, read_messages(path, [Particles]), strict=True):
        assert isinstance(seen, Particles)
        read = np.asarray(load_open3d().io.read_point_cloud(str(file)).points, np.float32)
        assert np.array_equal(read, seen.surface if what == "surface" else seen.positions)


def test_arrays_are_read_back_as_pushes(tmp_path: Path) -> None:
    path = demonstration(tmp_path)
    assert write_npz(path, tmp_path / "pushes.npz") == SHOWN
    (episode,) = read_plain(tmp_path / "pushes.npz").episodes
    assert len(episode.pushes) == SHOWN
    assert episode.state is not None
    seen = [message for message in read_messages(path, [Particles]) if isinstance(message, Particles)]
    for push, before, after in zip(episode.pushes, seen, seen[1:], strict=False):
        assert [sight.phase for sight in push] == ["before", "after"]
        assert np.array_equal(push[0].cloud, before.surface)
        assert np.array_equal(push[1].cloud, after.surface)
    made = read_transitions(path)[0].executed
    own = episode.command.between(made.times_s[0], made.times_s[-1])
    assert np.array_equal(own.poses, made.commanded)


def test_arrays_are_of_particles_where_these_are_asked_for_unless_they_were_imported(tmp_path: Path) -> None:
    path = demonstration(tmp_path, task="pour_water")
    write_npz(path, tmp_path / "pushes.npz", "particles")
    (episode,) = read_plain(tmp_path / "pushes.npz").episodes
    seen = [message for message in read_messages(path, [Particles]) if isinstance(message, Particles)]
    assert np.array_equal(episode.pushes[0][0].cloud, seen[0].positions)
    import_(tmp_path / "pushes.npz", output=tmp_path / "again.mcap")
    write_npz(tmp_path / "again.mcap", tmp_path / "again.npz", "particles")
    (again,) = read_plain(tmp_path / "again.npz").episodes
    assert np.array_equal(again.pushes[0][0].cloud, seen[0].positions)


def test_what_was_imported_and_exported_is_what_it_was(tmp_path: Path) -> None:
    arrays = plain_arrays(without=("during", "tool", "table"))
    first, second = tmp_path / "first.mcap", tmp_path / "second.npz"
    import_(saved(tmp_path, arrays), output=first)
    assert write_npz(first, second) == EPISODES * PUSHES
    with np.load(second, allow_pickle=False) as again:
        for name in ("cloud_points", "cloud_offsets", "cloud_time", "cloud_push"):
            expected = arrays[name] if name != "cloud_push" else np.repeat(np.arange(EPISODES * PUSHES), 2)
            assert np.array_equal(again[name], expected), name
        assert np.array_equal(again["cloud_episode"], arrays["cloud_episode"])


def test_a_recording_without_clouds_says_so(tmp_path: Path) -> None:
    path = record(tmp_path, Maker(seed=0)(Episode), [])
    with pytest.raises(RecordingError, match="holds no cloud"):
        write_ply(path, tmp_path / "ply", "surface")
    with pytest.raises(RecordingError, match="holds no push"):
        write_npz(path, tmp_path / "a.npz")
    assert not (tmp_path / "a.npz").exists()
