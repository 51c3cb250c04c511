"""Recordings of water, each with effects, tuning and noise of one seed; and the chain from `dipac hide` on."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.commands.hide import hide
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

TASK = PourCase(seed=0).task
BOWLS = subject_of(load("pour_water")).bowls or pytest.fail("the task has bowls")


def case(*effects: str, seed: int = 7) -> PourCase:
    return PourCase(seed=seed, hidden=tuple(Chosen(effect=name, size=1.0) for name in effects), plan=pour_design(1, 2))


def at_rest(share: float, aside_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> StampedSnapshot:
    """A world in which so much is in the fixed bowl; the held one is `aside_m` of where the kinematics have it."""
    told = pointing_down(np.array([*beside((0.55, 0.0), 2.0), 0.144]))
    tool = told.copy()
    tool[:3] += aside_m
    start = TASK.start(0)
    held = start - start.mean(0) + tool[:3] - [0.0, 0.0, 0.03]
    poured = round(share * len(held))
    held[:poured] += np.array([0.55, 0.0, 0.065]) - tool[:3]
    snapshot = Snapshot(time_s=0.0, nodes=held, tool=tool, joints=solve_joints(tool))
    return StampedSnapshot(stamp_s=0.0, snapshot=snapshot, told=told)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_view_shows_how_much_was_poured_and_the_rest_where_the_kinematics_have_the_bowl(share: float) -> None:
    look, rng = at_rest(share, (0.006, 0.0, 0.0)), np.random.default_rng(0)
    points = view_of_pour(TASK, look, rng).points
    assert look.told is not None
    assert points.shape == (300, 3)
    assert BOWLS.share(points) == pytest.approx(share, abs=0.08)
    held = points[~BOWLS.inside(points)]
    assert np.linalg.norm(held - look.told[:3], axis=1).max() < 0.055
    assert held.mean(0)[:2] == pytest.approx(look.told[:2], abs=2e-3)


def test_noisier_cameras_err_more() -> None:
    look = at_rest(0.5)

    def scatter(scale: float) -> float:
        found = [BOWLS.share(view_of_pour(TASK, look, np.random.default_rng(n), scale).points) for n in range(6)]
        return float(np.std(found))

    assert scatter(0.0) < 0.005 < scatter(3.0)


@pytest.mark.slow
def test_what_is_hidden_changes_what_is_poured_and_nothing_before() -> None:
    # A pour that is over ends where the lip is at the level, however thick the water: this one is held too short.
    control, again, hidden = (case(*effects, seed=10).record() for effects in ((), (), ("liquid_viscosity",)))

    def shares(study: Study) -> list[float]:
        return [BOWLS.share(push.after.points) for push in study.pushes]

    assert control.task == "pour_water"
    assert all(
        one.after.points.tobytes() == two.after.points.tobytes()
        for one, two in zip(control.pushes, again.pushes, strict=True)
    )
    assert np.array_equal(hidden.pushes[0].before.points, control.pushes[0].before.points)
    assert np.array_equal(hidden.pushes[0].command.poses, control.pushes[0].command.poses)
    assert abs(shares(hidden)[0] - shares(control)[0]) > 0.02


@pytest.mark.slow
def test_recordings_of_hidden_water_are_read_as_pours_with_the_bowl_where_it_was(tmp_path: Path) -> None:
    folder = tmp_path / "water"
    hide(("tcp_offset=0.006",), seed=5, output=folder, episodes=1, pushes=1, task="pour_water")
    study = read_study(sorted(folder.glob("*.mcap")))
    (push,) = study.pushes
    (during,) = push.during
    truth = json.loads((tmp_path / "water.truth.json").read_text(encoding="utf-8"))
    (effect,) = truth["effects"]
    offset = np.array([value["value"] for value in effect["parameters"].values()])
    assert during.finger is not None
    off = during.finger.mean(0) - push.track.at(np.array([during.time_s]))[0]
    assert np.linalg.norm(off) == pytest.approx(np.linalg.norm(offset), abs=1.5e-3)
    assert push.before.points.shape == (300, 3)
