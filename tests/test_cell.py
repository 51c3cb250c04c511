"""The main job on a short episode, started as a user starts it: `dipac run rope_push` with one push.

The physics of the cell is MuJoCo's, the images are ray-cast, and the processes are those of every run.
"""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.__main__ import main
from app.core.messages import (
    Executed,
    Frame,
    Goal,
    Health,
    Message,
    MessageId,
    Model,
    Outcome,
    Particles,
    Proposal,
    Transition,
)
from app.recording.read.reader import read_episode, read_messages
from tests.conftest import ROOT

pytestmark = pytest.mark.serial

SEED, PUSHES = 8, 1
"""Seed of a rope so far from its goal that so many pushes do not bring it there."""


@dataclass
class Ran:
    """Results of one run."""

    process: "subprocess.CompletedProcess[str]"
    outcome: dict[str, Any]
    messages: list[Message]

    def all(self, kind: type[Message]) -> list[Any]:
        return [message for message in self.messages if isinstance(message, kind)]


def dipac(*arguments: str | Path, cwd: Path = ROOT, timeout_s: float = 300) -> "subprocess.CompletedProcess[str]":
    """The command line as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "app", *map(str, arguments)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("cell")
    outcome = folder / "outcome.json"
    process = dipac(
        *("run", "rope_push", "--seed", SEED, "--pushes", PUSHES, "--preset", "cpu"),
        *("--json", outcome, "--recordings", folder, "--port", "0"),
        timeout_s=580,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    row = json.loads(outcome.read_text())
    return Ran(process=process, outcome=row, messages=list(read_messages(Path(row["recording"]))))


def test_the_outcome_has_its_promised_keys_and_no_fault(ran: Ran) -> None:
    row = ran.outcome
    promised = {"task", "seed", "rig", "chamfer_m2", "decision_s", "cost_before", "cost_after", "faults", "recording"}
    assert promised <= row.keys()
    assert (row["task"], row["seed"], row["rig"]) == ("rope_push", SEED, "simulated")
    assert len(row["chamfer_m2"]) == PUSHES + 1
    assert len(row["decision_s"]) == len(row["cost_before"]) == len(row["cost_after"]) == PUSHES
    assert row["faults"] == []


def test_the_rope_comes_nearer_to_its_goal_and_descent_lowers_every_cost(ran: Ran) -> None:
    assert ran.outcome["chamfer_m2"][-1] < ran.outcome["chamfer_m2"][0]
    assert all(
        after < before for before, after in zip(ran.outcome["cost_before"], ran.outcome["cost_after"], strict=True)
    )


def test_a_line_a_push_the_consoles_address_and_the_recording_are_printed(ran: Ran) -> None:
    printed = ran.process.stdout
    assert "Operator console: http://127.0.0.1:" in printed
    assert printed.count(" mm  ") >= PUSHES
    assert ran.outcome["recording"] in printed
    assert f"The goal is {'' if ran.outcome['reached'] else 'not '}reached." in printed


def test_every_executed_motion_leads_back_to_frames_model_and_plan(ran: Ran) -> None:
    known: dict[MessageId, Message] = {message.id: message for message in ran.messages}

    def causes(message: Message) -> set[type[Message]]:
        found: set[type[Message]] = set()
        for cause in message.cause:
            found |= {type(known[cause])} | causes(known[cause])
        return found

    executed = ran.all(Executed)
    assert len(executed) == PUSHES
    for motion in executed:
        assert {Proposal, Particles, Frame, Goal, Model} <= causes(motion)


def test_what_was_shown_is_what_was_executed(ran: Ran) -> None:
    for proposal, executed in zip(ran.all(Proposal), ran.all(Executed), strict=True):
        assert executed.outcome == "completed"
        path = proposal.motion.positions
        apart = np.linalg.norm(executed.measured[:, None, :3] - path[None], axis=-1).min(axis=0)
        assert apart.max() < 0.005


def test_the_model_is_calibrated_in_the_background_from_what_was_measured(ran: Ran) -> None:
    versions = [model.version for model in ran.all(Model)]
    assert versions == list(range(len(versions)))
    assert len(versions) > 1
    assert len(ran.all(Transition)) == len(ran.all(Outcome)) == PUSHES
    models = {model.id: model for model in ran.all(Model)}
    assert all(models[proposal.model_id].version == proposal.model_version for proposal in ran.all(Proposal))


def test_nothing_said_is_missing_from_the_recording(ran: Ran) -> None:
    assert ran.outcome["recorded"] == ran.outcome["said"] + 1
    assert len(ran.messages) == ran.outcome["recorded"]
    assert len({message.id for message in ran.messages}) == len(ran.messages)
    assert ran.all(Health)[-1].faults == 0
    episode = read_episode(Path(ran.outcome["recording"]))
    assert (episode.task, episode.seed, episode.simulated) == ("rope_push", SEED, True)


@pytest.mark.slow
def test_a_recording_calibrates_a_model_that_another_run_starts_from(ran: Ran, tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    fitted = dipac("calibrate", ran.outcome["recording"], "-o", model)
    assert fitted.returncode == 0, fitted.stderr
    assert "table_friction" in fitted.stdout
    again = dipac(*("run", "rope_push", "--pushes", "0", "--model", model, "--recordings", tmp_path, "--port", "0"))
    assert again.returncode == 0, again.stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "rope_pull"], "Did you mean 'rope_push'"),
        (["run", "rope_push", "--goal", "nowhere.npy"], "nowhere.npy"),
        (["run", "rope_push", "--goal", "outside.npy"], "outside the workspace"),
        (["run", "rope_push", "--model", "bad.toml"], "stiffness"),
        (["run", "rope_push", "--recordings", "a_file"], "a_file"),
        (["run", "rope_push", "--port", "70000"], "--port"),
        (["run", "rope_push", "--pushes", "-1"], "--pushes"),
        (["run", "rope_push", "--seed", "-1"], "--seed"),
        (["run", "rope_push", "--speed", "2"], "--speed"),
        (["run", "rope_push", "--speed", "nan"], "--speed"),
        (["calibrate", "cut.mcap"], "recover"),
        (["calibrate"], "at least one recording"),
        (["bench", "cells"], "Did you mean 'cell'"),
    ],
)
def test_bad_input_is_said_in_one_line_before_anything_moves(
    ran: Ran,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("outside.npy", np.array([[0.5, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    Path("a_file").write_text("not a folder")
    Path("cut.mcap").write_bytes(Path(ran.outcome["recording"]).read_bytes()[:200_000])
    Path("bad.toml").write_text(model_file(stiffness=float("nan")))
    assert main(arguments) not in (0, 1)
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert says in lines[0]


def model_file(*, stiffness: float) -> str:
    """A model of the task, sound but for its stiffness."""
    values = {"stiffness": stiffness, "table_friction": 0.4, "finger_friction": 0.3, "film_drag": 0.0}
    return 'schema = 1\ntask = "rope_push"\nversion = 1\nloss_m2 = 0.0\ntransition_count = 1\n' + "".join(
        f"[parameters.{name}]\nvalue = {value}\nunit = '1'\nlow = 0.0\nhigh = 1.0\n" for name, value in values.items()
    )
