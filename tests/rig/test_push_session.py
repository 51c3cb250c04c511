"""Rehearsals: what happens on the world's clock is what is recorded, but for what is hidden."""

import numpy as np
import pytest

from app.policy.random_pushes import REGION, PushDesign
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import BEGIN_S, SLOT_S, PushSample, first_start
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks import load
from bench.rehearsal import rehearse
from tests.rig.hidden.moments import injected

TASK = load("rope_push")
PLAN = PushDesign(episodes=2, pushes=2, speeds_m_s=(0.15, 0.30), lengths_m=(0.06, 0.08))


def takes(*hidden: InjectedEffect, seed: int = 1, plan: PushDesign = PLAN) -> list[PushSample]:
    return list(rehearse(TASK, plan, WorldPhysics(), hidden, seed))


@pytest.fixture(scope="module")
def plain() -> list[PushSample]:
    return takes()


def test_pushes_come_at_even_times_and_move_the_rope(plain: list[PushSample]) -> None:
    assert [take.before.stamp_s for take in plain] == pytest.approx(BEGIN_S + SLOT_S * np.arange(4), abs=1e-6)
    assert [take.episode for take in plain] == [0, 0, 1, 1]
    for take in plain:
        times = (take.before.stamp_s, take.command.times_s[0], take.during.stamp_s, take.command.end_s)
        assert np.all(np.diff([*times, take.after.stamp_s]) > 0)
        moved = np.abs(take.after.snapshot.nodes - take.before.snapshot.nodes).max()
        assert 0.005 < moved < 0.3
        xy = take.command.positions[:, :2]
        assert np.all((xy > np.array(REGION[:2]) - 0.05) & (xy < np.array(REGION[2:]) + 0.05))


def test_an_arm_without_errors_is_where_it_was_told_to_be_and_says_so(plain: list[PushSample]) -> None:
    for take in plain:
        at = take.command.at(np.array([take.during.stamp_s]))[0]
        # To within a time step of the world.
        assert take.during.snapshot.tip == pytest.approx(at, abs=0.3 * 0.002)
        assert np.abs(take.measured.positions - take.command.positions).max() < 6e-4
        assert take.during.snapshot.time_s == pytest.approx(take.during.stamp_s, abs=1.1e-3)


def test_the_same_seed_gives_the_same_session_to_the_last_bit_and_another_gives_another(
    plain: list[PushSample],
) -> None:
    again, other = takes(), takes(seed=2)
    for one, two in zip(plain, again, strict=True):
        assert np.array_equal(one.after.snapshot.nodes, two.after.snapshot.nodes)
        assert np.array_equal(one.measured.poses, two.measured.poses)
    assert not np.array_equal(plain[0].before.snapshot.nodes, other[0].before.snapshot.nodes)


def test_the_rope_is_laid_anew_in_each_episode_with_its_ends_nearest_to_where_they_were(
    plain: list[PushSample],
) -> None:
    last, laid = plain[1].after.snapshot.nodes, plain[2].before.snapshot.nodes
    ends = last[[0, -1], :2]
    assert np.linalg.norm(laid[[0, -1], :2] - ends) <= np.linalg.norm(laid[[-1, 0], :2] - ends)
    assert plain[0].before.snapshot.nodes[0, :2] == pytest.approx(first_start(TASK, PLAN, 1)[0, :2], abs=2e-3)


def test_a_late_image_shows_a_later_world_and_is_stamped_as_any(plain: list[PushSample]) -> None:
    late = takes(injected("camera_time_offset", 0.05), plan=PushDesign(**(vars(PLAN) | {"episodes": 1, "pushes": 1})))[
        0
    ]
    assert late.during.stamp_s == plain[0].during.stamp_s
    assert late.during.snapshot.time_s == pytest.approx(late.during.stamp_s + 0.05, abs=1.1e-3)


def test_what_encoders_see_is_measured_and_what_they_do_not_is_only_done() -> None:
    once = PushDesign(**(vars(PLAN) | {"episodes": 1, "pushes": 1}))
    told = takes(injected("command_delay", 0.2), plan=once)[0]
    behind = told.command.at(told.command.times_s - 0.2)
    assert np.abs(told.measured.positions - behind).max() < 6e-4
    askew = takes(injected("tcp_offset", 0.0, 0.0, -0.01), plan=once)[0]  # The tool points down.
    assert np.abs(askew.measured.positions - askew.command.positions).max() < 6e-4
    at = askew.command.at(np.array([askew.during.stamp_s]))[0]
    assert askew.during.snapshot.tip[2] - at[2] == pytest.approx(0.01, abs=1e-4)
