"""Stories of hidden causes: their commands, and what is said of rows that are there."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.commands.evaluate import EPISODES
from app.services.study import read_study
from app.tasks import load
from bench.hidden.draws import BODIES, Making, kinds
from bench.hidden.made import make
from bench.stories import DOCS, MODELS, STORIES, Pair, Story, draw, gains, pairs, section, table, told_of

PAGE = (DOCS / "stories.md").read_text(encoding="utf-8")


def row(seed: int, chamfer_m2: float, *, share: float = 0.9, failure: str = "") -> dict[str, object]:
    return {
        "key": f"task {seed}",
        "seed": seed,
        "chamfer_m2": chamfer_m2,
        "chamfers_m2": [1e-3, chamfer_m2],
        "reward": share,
        "success": share > 0.8,
        "failure": failure,
    }


def played(folder: Path, count: int = 6) -> list[Pair]:
    """Problems in which the extended model ends 50 mm^2 nearer, and one that the nominal one alone has played."""
    for model in MODELS:
        (folder / model).mkdir()
        nearer = 50e-6 if model == "extended" else 0.0
        lines = [row(seed, 200e-6 + 10e-6 * seed - nearer) for seed in range(count)]
        if model == "nominal":
            lines.append(row(count, 1e-3))
        (folder / model / EPISODES).write_text("".join(json.dumps(line) + "\n" for line in lines))
    return pairs(folder, count + 3)


@pytest.mark.parametrize("story", STORIES, ids=[story.task for story in STORIES])
def test_what_is_hidden_can_be_named_and_changes_where_things_go(story: Story) -> None:
    making = Making(dynamics="mpm", images=False, task=story.task)
    assert story.hidden in kinds(making.worlds[0], making)
    assert story.hidden not in {"command_delay", "actuator_lag", "camera_time_offset"}
    assert load(story.played).problem == story.task
    for model in MODELS:
        words = story.evaluate(model, 10)
        assert words[words.index("--hidden") + 1] == "truth.json"
        assert words[words.index("-o") + 1] == model
    assert len({" ".join(story.evaluate(model, 10)).replace(model, "") for model in MODELS}) == 2


def test_there_is_a_story_of_every_task_whose_object_is_no_rope() -> None:
    assert sorted(story.task for story in STORIES) == sorted(set(BODIES) - {"rope_push"})


@pytest.mark.parametrize("story", STORIES, ids=[story.task for story in STORIES])
def test_the_page_says_what_is_hidden_in_each_task(story: Story) -> None:
    assert told_of(story) in PAGE


def test_pairs_are_the_problems_that_both_have_played_and_gains_are_of_the_same_problem(tmp_path: Path) -> None:
    found = played(tmp_path)
    assert [pair.seed for pair in found] == list(range(6))
    chamfer, share = gains(found)
    assert chamfer.value == pytest.approx(-50e-6)
    assert chamfer.n == 6
    assert (share.value, share.low) == (0.0, 0.0)
    text = table(found)
    assert "| nominal | 6 | 0 |" in text
    assert "-50 (-50 to -50), nearer in 6" in text


def test_a_story_shows_its_commands_what_was_printed_and_what_was_hidden(tmp_path: Path) -> None:
    story, found = STORIES[0], played(tmp_path)
    effect = {"effect": "under_reach", "parameters": {"under_reach": {"value": 0.15, "unit": "1", "null": 0.0}}}
    text = section(story, "Cause: under_reach", {"effects": [effect]}, found, 10)
    assert "dipac discover recordings/*.mcap -o discovery" in text
    assert json.loads(text.split("echo '")[1].split("' >")[0]) == story.order
    assert "Hidden was: `under_reach` (under_reach 0.15 1)." in text
    assert "Cause: under_reach" in text
    assert table(found) in text


def test_its_figure_is_drawn(tmp_path: Path) -> None:
    draw(STORIES[0], played(tmp_path), tmp_path / "story.svg")
    assert "extended" in (tmp_path / "story.svg").read_text()


def test_a_cloth_that_is_seen_without_images_is_read_by_discovery(tmp_path: Path) -> None:
    order = STORIES[1].order | {"episodes": 1, "pushes": 1}
    make(order, tmp_path)
    study = read_study(sorted((tmp_path / "recordings").iterdir()))
    (push,) = study.pushes
    assert push.before.points.shape == push.after.points.shape
    assert push.track.poses.shape[1] == 8  # With the opening, which closes.
    assert np.ptp(push.track.poses[:, 7]) > 0.02
    assert np.abs(push.after.points.mean(0) - push.before.points.mean(0)).max() > 0.03
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert [each["effect"] for each in truth["effects"]] == ["under_reach"]
