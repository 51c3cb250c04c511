"""`dipac collect` records its expert's episodes, and `dipac calibrate` learns from them and draws how it went."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.commands.calibrate import calibrate
from app.core.dialogue.approval import Approved
from app.core.errors import UsageError
from app.core.messages import Decision, Episode, Executed, Frame, Goal, Outcome, Particles, Proposal, Transition
from app.evaluation import demonstrate
from app.recording.exchange.model_file import load_model
from app.recording.format.channels import record_of
from app.recording.format.integrity import inspect
from app.recording.read.reader import read_episode, read_messages, read_transitions
from app.tasks import load


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two actions an episode."""
    orders = demonstrate.EvaluationConfig

    def order(**said: object) -> demonstrate.EvaluationConfig:
        return orders(**{**said, "actions": 2})  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(demonstrate, "EvaluationConfig", order)


@pytest.mark.usefixtures("short")
def test_a_demonstration_is_a_whole_recording_of_what_was_seen_planned_and_made(tmp_path: Path) -> None:
    assert main(["collect", "rope_push", "--episodes", "1", "--preset", "cpu", "-o", str(tmp_path)]) == 0
    (path,) = tmp_path.glob("*.mcap")
    assert path.name == "rope_push-1000.mcap"
    inspect(path)
    assert read_episode(path).task == "rope_push"
    kinds = (Episode, Goal, Frame, Particles, Proposal, Decision, Approved, Executed, Transition, Outcome)
    messages = list(read_messages(path, kinds))
    counts = {kind: sum(isinstance(message, (kind, record_of(kind))) for message in messages) for kind in kinds}
    assert counts == {Episode: 1, Goal: 1, Frame: 4, Particles: 3} | dict.fromkeys(kinds[4:], 2)
    # Each motion leads back to the particles that it was planned for.
    by_id = {message.id: message for message in messages}
    for executed in (message for message in messages if isinstance(message, Executed)):
        approved = by_id[executed.approved_id]
        assert set(approved.cause) <= by_id.keys()
        assert set(by_id[approved.proposal_id].cause[:2]) <= by_id.keys()
    # What the object looked like before each action: the images that a policy learns from.
    seen = [message for message in messages if isinstance(message, Particles)]
    frames = {message.id for message in messages if isinstance(message, Frame)}
    assert all(len(particles.cause) == 2 and frames.issuperset(particles.cause) for particles in seen[:2])
    first, second = read_transitions(path)
    assert first.after.shape == (load("rope_push").preset("cpu").particle_count, 3)
    assert (first.after == second.before).all()
    outcomes = [message for message in messages if isinstance(message, Outcome)]
    assert outcomes[0].chamfer_after_m2 == outcomes[1].chamfer_before_m2


@pytest.mark.usefixtures("short")
def test_recordings_are_never_written_over_and_calibrate_a_model_with_a_plot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    order = ["collect", "rope_push", "--episodes", "1", "--preset", "cpu", "--eyes", "truth", "-o", str(tmp_path)]
    assert main(order) == main(order) == 0
    paths = sorted(tmp_path.glob("*.mcap"))
    assert [path.name for path in paths] == ["rope_push-1000-2.mcap", "rope_push-1000.mcap"]
    one, other = (read_transitions(path) for path in paths)
    assert [(first.after == again.after).all() for first, again in zip(one, other, strict=True)] == [True, True]
    model = tmp_path / "model.toml"
    assert main(["calibrate", *map(str, paths), "-o", str(model)]) == 0
    assert f"how it went to {tmp_path / 'model.svg'}" in capsys.readouterr().out.replace("\n", "")
    drawn = (tmp_path / "model.svg").read_text()
    for name in load("rope_push@rods").calibrated:
        assert name in drawn
    found = load_model(model, task="rope_push@rods", time_s=0.0)
    assert found.transition_count == 4
    assert found.version == 1


@pytest.mark.usefixtures("short")
def test_a_demonstration_with_a_cable_is_another_one_and_says_so(tmp_path: Path) -> None:
    order = ["collect", "rope_push", "--episodes", "1", "--preset", "cpu", "--eyes", "truth"]
    for world in ("chain", "cable"):
        assert main([*order, "--world", world, "-o", str(tmp_path / world)]) == 0
    chain, cable = (next((tmp_path / world).glob("*.mcap")) for world in ("chain", "cable"))
    assert [json.loads(read_episode(path).config)["world"] for path in (chain, cable)] == ["chain", "cable"]
    assert not np.array_equal(read_transitions(chain)[0].after, read_transitions(cable)[0].after)


def test_a_world_of_ropes_is_refused_for_a_task_without_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    order = ["collect", "bean_sweep", "--preset", "cpu", "--world", "cable", "-o", str(tmp_path / "new")]
    assert main(order) == UsageError.exit_code
    assert "--world cable is of tasks with a rope, not with Beans" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_a_demonstration_of_another_task_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.calibrate.read_episode", lambda path: _Other(path.stem))
    recordings = [tmp_path / "rope_push.mcap", tmp_path / "bean_sweep.mcap"]
    with pytest.raises(UsageError, match=r"bean_sweep\.mcap: bean_sweep"):
        calibrate(tuple(recordings), output=tmp_path / "model.toml")


class _Other:
    """An episode of a task."""

    def __init__(self, task: str) -> None:
        self.task = task


@pytest.mark.parametrize("wrong", [["nothing"], ["rope_push", "--episodes", "0"], ["rope_push", "--seed", "-1"]])
def test_an_impossible_order_is_refused_before_anything_is_played(
    wrong: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["collect", *wrong, "--preset", "cpu", "-o", str(tmp_path / "new")]) == UsageError.exit_code
    assert wrong[-1] in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


@pytest.mark.usefixtures("short")
def test_what_misses_its_goal_is_not_kept_where_only_the_rest_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    order = ["collect", "rope_push", "--episodes", "1", "--preset", "cpu", "--eyes", "truth", "-o", str(tmp_path)]
    assert main([*order, "--expert", "descended", "--reached"]) == 0
    said = capsys.readouterr().out
    assert [line.split(":")[0] for line in said.splitlines() if "not kept" in line] == [
        "rope_push 1000",
        "rope_push 1001",
    ]
    assert [path.name for path in tmp_path.glob("*.mcap")] == ["rope_push-1002.mcap"]
    assert "1 of 1 recorded episodes reached their goal" in said
