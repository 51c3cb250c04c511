"""A film is the part of a recording that all its cameras saw, frame by frame as it was recorded."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.errors import RecordingError, UsageError
from app.core.messages import Frame
from app.recording.read.film import film_frames, film_states, read_film
from app.recording.read.reader import read_messages
from tests.recording.films import BEGIN_S, filmed, frame, frames, states
from tests.recording.samples import Maker


def film_of(folder: Path, make: Maker, **times_s: Sequence[float]) -> Path:
    return filmed(folder / "film.mcap", frames(times_s, make), make)


def test_its_frames_are_those_of_the_recording_in_order_and_of_the_cameras_themselves(
    tmp_path: Path, make: Maker
) -> None:
    path = film_of(tmp_path, make, left=[0.0, 0.5, 1.0], right=[0.01, 0.51, 1.01])
    film, recorded = read_film(path), list(read_messages(path, [Frame]))
    shown = list(film_frames(film))
    assert list(film.cameras) == ["left", "right"]
    assert not film.unseen_s
    assert [each.id for each in shown] == [each.id for each in recorded]
    for one, other in zip(shown, recorded, strict=True):
        assert isinstance(other, Frame)
        assert one.camera is film.cameras[other.camera.name]
        assert np.array_equal(one.camera.T_world_camera, other.camera.T_world_camera)
        assert np.array_equal(one.color, other.color)
        assert np.array_equal(one.depth, other.depth)


def test_it_begins_with_the_last_camera_and_ends_with_the_first_that_ends(tmp_path: Path, make: Maker) -> None:
    path = film_of(tmp_path, make, left=[0.0, 1.0, 2.0, 3.0, 4.0], right=[0.9, 1.9])
    film = read_film(path)
    assert [(each.camera.name, round(each.time_s - BEGIN_S, 2)) for each in film_frames(film)] == [
        ("right", 0.9),
        ("left", 1.0),
        ("right", 1.9),
        ("left", 2.0),
    ]
    assert film.unseen_s == pytest.approx({"left": 1.9})


@pytest.mark.parametrize(
    ("left", "right", "said"),
    [
        ([], [], "holds no images"),
        ([0.0, 1.0], [2.0, 3.0], "all its cameras looked"),
        ([0.0, 10.0], [5.0], "all its cameras looked"),
    ],
    ids=["none", "one after the other", "one in a gap of the other"],
)
def test_a_recording_in_which_cameras_never_looked_together_is_refused(
    tmp_path: Path, make: Maker, left: list[float], right: list[float], said: str
) -> None:
    path = film_of(tmp_path, make, left=left, right=right)
    with pytest.raises(RecordingError, match=said):
        read_film(path)


@pytest.mark.parametrize("change", ["moved", "another lens"])
def test_a_camera_that_becomes_another_is_refused_where_it_does(tmp_path: Path, make: Maker, change: str) -> None:
    taken = frames({"left": [0.0], "right": [0.0]}, make)
    model = taken[0].camera
    if change == "moved":
        other = replace(model, T_world_camera=model.T_world_camera + 1e-3)
    else:
        other = replace(model, K=model.K * 1.01)
    path = filmed(tmp_path / "film.mcap", [*taken, frame(other, BEGIN_S + 0.1, 2)], make)
    shown = film_frames(read_film(path))
    assert {next(shown).camera.name, next(shown).camera.name} == {"left", "right"}
    with pytest.raises(RecordingError, match="is another one later"):
        next(shown)


def test_the_arm_that_was_recorded_with_it_is_known_in_order(tmp_path: Path, make: Maker) -> None:
    known = states([0.0, 0.5, 1.0], make)
    path = filmed(tmp_path / "film.mcap", [*frames({"left": [0.2], "right": [0.2]}, make), *known], make)
    assert [state.id for state in film_states(read_film(path))] == [state.id for state in known]


def test_a_file_that_is_none_is_said(tmp_path: Path, make: Maker) -> None:
    with pytest.raises(UsageError, match="recording"):
        read_film(tmp_path / "nowhere.mcap")
    (tmp_path / "text.mcap").write_text("not a recording")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        read_film(tmp_path / "text.mcap")
