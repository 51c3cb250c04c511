"""Recordings of soup: what is seen of its pieces, and the chain from `dipac hide` on."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.commands.hide import hide
from app.core.geometry.scene_description import Soup
from app.core.motion import pointing_down
from app.discovery.dataset.study import Study
from app.jobs.discovery_subject import subject_of
from app.policy.random_pours import beside, pour_design
from app.rig.simulated.push_session import StampedSnapshot
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot
from app.services.study import read_study
from app.tasks import load
from bench.hidden.draws import Chosen
from bench.hidden.pours import PourCase, view_of_pour

CASE = PourCase(seed=0, of="pour_soup")
TASK = CASE.task
SUBJECT = subject_of(load("pour_soup"))
BOWLS = SUBJECT.bowls or pytest.fail("the task has bowls")
BROTH, PIECES = SUBJECT.scene.split(SUBJECT.particle_count)
TOLD = pointing_down(np.array([*beside((0.55, 0.0), 2.0), 0.144]))


def recorded(*effects: str) -> Study:
    hidden = tuple(Chosen(effect=name, size=1.0) for name in effects)
    return PourCase(seed=7, of="pour_soup", hidden=hidden, plan=pour_design(1, 2)).record()


def at_rest(broth: float, pieces: int, lower_m: float = 0.0) -> StampedSnapshot:
    """A world with so much of the broth, and so many pieces `lower_m` under their places, in the fixed bowl."""
    nodes = TASK.start(0)
    drops = len(nodes) - 6 * 27
    held = nodes - nodes.mean(0) + TOLD[:3] - [0.0, 0.0, 0.03]
    place = np.array([0.55, 0.0, 0.065]) - TOLD[:3]
    held[: round(broth * drops)] += place
    held[drops : drops + 27 * pieces] += place - [0.0, 0.0, lower_m]
    snapshot = Snapshot(time_s=0.0, nodes=held, tool=TOLD, joints=solve_joints(TOLD))
    return StampedSnapshot(stamp_s=0.0, snapshot=snapshot, told=TOLD)


def test_the_cases_soup_has_fewer_drops_as_large_as_the_grains_of_its_pieces() -> None:
    body = TASK.stage.body
    assert isinstance(body, Soup)
    nodes = TASK.start(3)
    assert len(nodes) == 633 + 6 * 27
    assert body.volume_m3 == pytest.approx(load("pour_soup").stage.body.volume_m3)
    assert body.liquid.volume_m3 / 633 == pytest.approx(0.016**3 / 27, rel=1e-3)


def test_pieces_are_seen_where_they_are_held_and_are_the_last_particles() -> None:
    points = view_of_pour(TASK, at_rest(0.4, 0), np.random.default_rng(0)).points
    assert len(points) == BROTH + PIECES
    assert BOWLS.share(points) == pytest.approx(0.4 * 96 / 120.6, abs=0.04)
    assert BOWLS.share(points[BROTH:]) == 0.0


def test_pieces_under_the_broth_are_not_seen_and_taken_to_be_with_the_others() -> None:
    rng = np.random.default_rng(0)
    some = view_of_pour(TASK, at_rest(0.7, 3, lower_m=0.02), rng).points[BROTH:]
    assert BOWLS.share(some) == 0.0
    every = view_of_pour(TASK, at_rest(0.7, 6, lower_m=0.02), rng).points[BROTH:]
    assert BOWLS.share(every) == pytest.approx(0.76, abs=0.15)


@pytest.mark.parametrize("of", ["pour_soup", "pour_water"])
def test_of_more_liquid_than_is_said_more_stands_and_as_much_less_is_taken_for_held(of: str) -> None:
    task = PourCase(seed=0, of=of).task  # pyright: ignore[reportArgumentType]
    nodes = task.start(0)
    half = nodes - nodes.mean(0) + TOLD[:3] - [0.0, 0.0, 0.03]
    half[::2] += np.array([0.55, 0.0, 0.065]) - TOLD[:3]
    look = StampedSnapshot(
        stamp_s=0.0, snapshot=Snapshot(time_s=0.0, nodes=half, tool=TOLD, joints=solve_joints(TOLD)), told=TOLD
    )
    usual, fuller = (
        BOWLS.share(view_of_pour(task, look, np.random.default_rng(1), 0.0, more).points) for more in (0.0, 0.2)
    )
    assert usual == pytest.approx(0.5, abs=0.04)
    # A pool of a given volume is found on a grid of 2 mm, half of which is 4 % of the liquid.
    assert fuller == pytest.approx(usual + 0.1, abs=0.06)


@pytest.mark.slow
def test_what_is_hidden_in_soup_changes_what_is_poured_and_nothing_before() -> None:
    control, soft = recorded(), recorded("piece_stiffness")
    assert control.task == "pour_soup"
    first, usual = soft.pushes[0], control.pushes[0]
    # Softer pieces come to rest a little lower.
    assert BOWLS.share(first.before.points) == BOWLS.share(usual.before.points) == 0.0
    assert np.array_equal(first.command.poses, usual.command.poses)
    assert BOWLS.share(first.after.points) > BOWLS.share(usual.after.points)


@pytest.mark.slow
def test_recordings_of_hidden_soup_are_read_as_pours_of_broth_and_pieces(tmp_path: Path) -> None:
    folder = tmp_path / "soup"
    hide(("fill_level=0.2",), seed=7, output=folder, episodes=1, pushes=1, task="pour_soup")
    study = read_study(sorted(folder.glob("*.mcap")))
    (push,) = study.pushes
    truth = json.loads((tmp_path / "soup.truth.json").read_text(encoding="utf-8"))
    (effect,) = truth["effects"]
    assert effect["parameters"]["fill_level"]["value"] == pytest.approx(0.2)
    assert push.before.points.shape == (BROTH + PIECES, 3)
    # Pieces swim: they are the upper part of what is in the bowl.
    assert push.before.points[BROTH:, 2].mean() > push.before.points[:BROTH, 2].mean() + 0.003
    assert push.during[0].finger is not None
