"""Own recordings: whole, read by discovery as they were made, and without a word of what is hidden in them."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from app.policy.random_pushes import PushDesign
from app.recording.format.integrity import inspect
from app.services.study import read_study
from bench.hidden.draws import WORLDS, kinds, outsiders
from bench.hidden.own import Order, record
from bench.hidden.trial import handed_over
from bench.own_world import CAMERA_M

SEED = 730915
PLAN = PushDesign(episodes=2, pushes=1)
HIDDEN = {"bias": (("depth_bias", 2.0),), "strange": (("swirl", 1.0),), "control": ()}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own")
    record([Order(name=name, seed=SEED, hidden=hidden) for name, hidden in HIDDEN.items()], PLAN, folder)
    return folder


def recordings(made: Path, name: str) -> list[Path]:
    return sorted((made / name / "recordings").iterdir())


@pytest.mark.parametrize("name", HIDDEN)
def test_they_are_whole_and_hold_what_discovery_reads(made: Path, name: str) -> None:
    for path in recordings(made, name):
        inspect(path)
    study = read_study(recordings(made, name))
    assert [push.episode for push in study.pushes] == [0, 1]
    assert sorted(study.tables) == [0, 1]
    assert study.camera == pytest.approx(CAMERA_M)
    for push in study.pushes:
        assert push.measured is not None
        assert len(push.during) == 1
        assert push.during[0].finger is not None
        assert push.before.time_s <= push.command.times_s[0] < push.command.times_s[-1] < push.after.time_s


def test_what_was_hidden_is_in_them(made: Path) -> None:
    """Depth that is too long puts the table below zero."""
    bias = told(made, "bias")["effects"][0]["parameters"]["depth_bias"]["value"]
    assert abs(bias) == pytest.approx(0.008)
    heights = {
        name: np.mean([table[:, 2].mean() for table in read_study(recordings(made, name)).tables.values()])
        for name in HIDDEN
    }
    assert np.sign(heights["bias"]) == -np.sign(bias)
    assert abs(heights["bias"]) > 0.005
    assert abs(heights["control"]) < 5e-4


def test_no_byte_tells_what_is_hidden_and_all_worlds_say_the_same_of_themselves(made: Path, tmp_path: Path) -> None:
    words = {str(SEED), "truth", "hidden", "bench", *HIDDEN}
    for world in WORLDS:
        words |= {*kinds(world), *outsiders(world)}
    said = dict[str, set[str]]()
    for name in HIDDEN:
        (tmp_path / name).mkdir()
        for path in handed_over(made / name / "recordings", tmp_path / name):
            contents = [path.read_bytes(), *messages(path)]
            assert not [word for word in words if any(word.encode() in content for content in contents)]
            said.setdefault(path.name, set()).add(metadata(path))
            assert path.stat().st_mtime == 0
    assert all(len(texts) == 1 for texts in said.values())


def test_the_solvers_folder_has_the_recordings_alone(made: Path, tmp_path: Path) -> None:
    handed_over(made / "bias" / "recordings", tmp_path)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["episode-01.mcap", "episode-02.mcap"]


def test_the_same_order_makes_the_same_bytes(made: Path, tmp_path: Path) -> None:
    record([Order(name=name, seed=SEED, hidden=hidden) for name, hidden in HIDDEN.items()], PLAN, tmp_path)
    for name in HIDDEN:
        for one, other in zip(recordings(made, name), recordings(tmp_path, name), strict=True):
            assert one.read_bytes() == other.read_bytes()


def told(made: Path, name: str) -> dict:
    return json.loads((made / name / "truth.json").read_text())


def messages(path: Path) -> list[bytes]:
    with path.open("rb") as stream:
        return [message.data for _, _, message in make_reader(stream).iter_messages()]


def metadata(path: Path) -> str:
    with path.open("rb") as stream:
        (record,) = make_reader(stream).iter_metadata()
    return json.dumps({key: value for key, value in record.metadata.items() if key != "time_s"})
