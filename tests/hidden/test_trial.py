"""A trial: recordings with their truth, a solver that is given the former, and failures that are lines, too."""

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from app.policy.random_pushes import PushDesign
from app.services.study import read_study
from bench.hidden.draws import WORLDS, Case, Chosen, Making
from bench.hidden.outcome import outcome
from bench.hidden.trial import Setup, handed_over, make, solved, told, tried
from tests.hidden.synthetic import blamed, line

SETUP = Setup(seed=3, plan=PushDesign(episodes=1, pushes=1), oracle=False, deadline_s=550.0)


@pytest.mark.serial
@pytest.mark.parametrize("world", WORLDS)
def test_both_worlds_hide_the_same_size_and_hand_over_recordings_alone(world, tmp_path: Path) -> None:
    case = Case(number=0, world=world, hidden=(Chosen(effect="depth_bias", size=2.0),))
    truth = make(case, SETUP, tmp_path)
    (effect,) = truth["effects"]
    assert effect["effect"] == "depth_bias"
    assert abs(effect["parameters"]["depth_bias"]["value"]) == pytest.approx(0.008)
    seen = tmp_path / "seen"
    seen.mkdir()
    assert [path.name for path in handed_over(tmp_path / "recordings", seen)] == ["episode-01.mcap"]
    assert [path.name for path in seen.iterdir()] == ["episode-01.mcap"]
    scored = outcome(line(case, ("named", [blamed("depth_bias", 0.9)], [])) | {"truth": truth})
    assert abs(scored.truths[0].size) == pytest.approx(0.008)
    assert scored.truths[0].typical == 2.0


@pytest.mark.serial
def test_recordings_that_are_kept_are_not_made_again(tmp_path: Path) -> None:
    kept = tmp_path / "own-0-3-1x1"
    kept.mkdir()
    (kept / "truth.json").write_text('{"effects": []}')
    (kept / "recordings").mkdir()
    (kept / "recordings" / "episode-01.mcap").write_bytes(b"no recording")
    made = tried(Case(number=0, world="own", hidden=()), replace(SETUP, made=tmp_path))
    assert "episode-01.mcap" in made["failure"]


@pytest.mark.serial
def test_what_cannot_be_read_is_a_failure_and_no_verdict(tmp_path: Path) -> None:
    path = tmp_path / "episode-01.mcap"
    path.write_bytes(b"no recording")
    with pytest.raises(subprocess.CalledProcessError) as caught:
        solved([path], tmp_path, SETUP)
    assert "episode-01.mcap" in caught.value.stderr


@pytest.mark.serial
def test_a_case_that_takes_too_long_is_a_line_that_says_so() -> None:
    case = Case(number=1, world="own", hidden=())
    hasty = Setup(seed=3, plan=SETUP.plan, oracle=False, deadline_s=0.05)
    made = tried(case, hasty)
    assert made["case"] == told(case, hasty)
    assert made["failure"].startswith("TimeoutExpired")
    assert "verdict" not in made


@pytest.mark.serial
def test_recordings_of_beans_say_which_beans(tmp_path: Path) -> None:
    beans = replace(SETUP, making=Making(dynamics="mpm", images=False, task="bean_sweep"))
    case = Case(number=0, world="mujoco", hidden=(Chosen(effect="table_tilt", size=0.5),))
    truth = make(case, beans, tmp_path)
    assert truth["task"].startswith("bean_sweep(count=")
    assert [each["effect"] for each in truth["effects"]] == ["table_tilt"]
    study = read_study(sorted((tmp_path / "recordings").iterdir()))
    assert (study.task, len(study.pushes)) == (truth["task"], 1)
    assert told(case, beans)["task"] == "bean_sweep"
