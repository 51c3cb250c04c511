"""`dipac train` makes a policy of recordings, which `evaluate` plays alone and which guides the tree."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import UsageError
from app.core.messages import Episode, Executed, Goal, MessageId, Transition, fresh_id
from app.core.motion import pointing_down
from app.evaluation import results_log
from app.evaluation.trial import Trial, playable, run_trial
from app.jobs.teaching import lessons
from app.planner.method import PAPER
from app.policy.learned.file import CHECKPOINT, FILE, load_policy
from app.recording.format.clock_offset import Epoch
from app.recording.library.demonstrations import read_taught
from app.recording.write.file import EpisodeFile
from app.tasks import load

TASK = load("rope_push")
COUNT = TASK.preset("cpu").particle_count


def demonstration(path: Path, seed: int, task: str = "rope_push") -> Path:
    """Two pushes along the table, of a rope that goes with them."""
    begun = Episode(
        id=MessageId(f"episode-{seed}"),
        time_s=0.0,
        task=task,
        rig="simulated",
        seed=seed,
        simulated=True,
        code_version="test",
        config="{}",
    )
    x, goal = TASK.particles(TASK.start(seed), COUNT), TASK.goal(seed, COUNT)
    file = EpisodeFile(path, begun, epoch=Epoch(offset_ns=0))
    file.write(begun, now_s=0.0)
    file.write(Goal(id=MessageId(f"goal-{seed}"), time_s=0.0, positions=goal), now_s=0.0)
    for number in (1, 2):
        after = x + np.float32([0.0, 0.01, 0.0])
        executed = pushed(x.mean(0), 0.04 * number, seed)
        told = Transition(id=fresh_id("transition"), time_s=2.0 * number, before=x, executed=executed, after=after)
        file.write(told, now_s=2.0 * number)
        x = after
    file.close()
    return path


def pushed(middle: np.ndarray, from_m: float, seed: int) -> Executed:
    """A push across the middle, along the table."""
    places = [
        np.array([middle[0], middle[1] + along, TASK.actions.reach[0][2]]) for along in np.linspace(-from_m, 0.04)
    ]
    poses = np.stack([pointing_down(place) for place in places])[:, :7]
    return Executed(
        id=fresh_id("executed"),
        time_s=float(seed),
        approved_id=MessageId("approved"),
        outcome="completed",
        reason="",
        times_s=np.linspace(0.0, 2.0, len(poses)),
        commanded=poses,
        measured=poses,
    )


@pytest.fixture
def demos(tmp_path: Path) -> list[str]:
    return [str(demonstration(tmp_path / f"{seed}.mcap", seed)) for seed in (1, 2)]


def train(demos: list[str], output: Path, *more: str) -> int:
    order = ["train", "rope_push", "--demos", *demos, "--steps", "2", "--batch", "2", "-o", str(output), *more]
    return main(order)


@pytest.mark.serial
def test_a_policy_of_recordings_goes_on_and_says_what_it_is_from(
    demos: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "policy"
    assert train(demos, output) == 0
    said = capsys.readouterr().out
    assert "4 actions of 2 demonstrations" in said
    assert f"dipac run rope_push --policy {output}" in said
    assert {each.name for each in output.iterdir()} == {FILE, CHECKPOINT, "learning.svg"}
    _, origin = load_policy(output, task="rope_push", how=lessons(TASK))
    assert origin.kind == "bc"
    assert origin.demonstrations == {Path(path).name: read_taught(Path(path)).digest for path in demos}
    assert train(demos, output) == 0
    assert "Going on" in capsys.readouterr().out
    for other, more in ((demos, ("--seed", "1")), (demos[::-1], ())):
        assert train(other, output, *more) == 2
        assert "other options or demonstrations" in capsys.readouterr().err


@pytest.mark.serial
def test_what_cannot_be_learned_from_is_refused_with_a_reason(
    demos: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "copies").mkdir()
    copy = shutil.copy(demos[0], tmp_path / "copies" / "another.mcap")
    assert train([*demos, str(copy)], tmp_path / "policy") == 2
    assert "same content (1.mcap, another.mcap)" in capsys.readouterr().err
    namesake = demonstration(tmp_path / "copies" / "1.mcap", 4)
    assert train([*demos, str(namesake)], tmp_path / "policy") == 2
    assert "same name (1.mcap)" in capsys.readouterr().err
    other = demonstration(tmp_path / "other.mcap", 3, task="bean_sweep")
    assert train([*demos, str(other)], tmp_path / "policy") == 2
    assert "other.mcap: bean_sweep" in capsys.readouterr().err
    assert train(demos, tmp_path / "policy", "--policy", "telepathy") == 2
    assert "transporter" in capsys.readouterr().err
    assert main(["run", "rope_push", "--policy", str(tmp_path / "nowhere")]) == 2
    assert "dipac train" in capsys.readouterr().err


@pytest.mark.serial
def test_a_learned_policy_plays_alone_and_guides_the_tree(
    demos: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(demos, tmp_path / "policies" / "rope_push" / "bc") == 0
    assert {"bc", f"{PAPER}+bc"} < set(playable())

    def trial(planner: str) -> Trial:
        return Trial(
            task="rope_push",
            planner=planner,
            ablation="none",
            seed=0,
            preset="cpu",
            eyes="truth",
            policies=tmp_path / "policies",
            actions=1,
        )

    alone, guided = trial("bc").method, trial(f"{PAPER}+bc").method
    assert alone.policy == guided.policy
    assert not alone.branching
    assert guided.branching
    (tmp_path / "results").mkdir()
    row = run_trial(trial("bc"))
    assert row["failure"] == "" or "branches" in row["failure"]
    assert row["policies"] == str(tmp_path / "policies")
    assert row["policy_digest"] == alone.policy.digest
    where = ["--policies", str(tmp_path / "policies"), "-o", str(tmp_path / "results")]
    short = ["--dynamics", "mpm", "--preset", "cpu", "--eyes", "truth", "--actions", "1", "--seeds", "1"]
    again = ["evaluate", "--task", "rope_push", "--planner", "bc", *short, *where]
    for digest, code in ((row["policy_digest"], 0), ("of another training", 2)):
        results_log.append(
            tmp_path / "results" / "episodes.jsonl", {"key": trial("bc").key} | row | {"policy_digest": digest}
        )
        assert main(again) == code
    assert "another policy for bc in rope_push" in capsys.readouterr().err
    with pytest.raises(UsageError, match="There is no policy"):
        _ = trial("act").method
    shutil.copytree(tmp_path / "policies" / "rope_push" / "bc", tmp_path / "policies" / "rope_push" / "ild")
    with pytest.raises(UsageError, match="of the kind bc, not ild"):
        _ = trial("ild").method
    for changes in ({"guided": False}, {"planner": "cem_mpc"}):
        with pytest.raises(UsageError, match="guides dipac alone"):
            replace(guided, **changes)
