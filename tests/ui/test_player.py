"""Position and speed of a replay, and the comparison of a plan with one that was made again."""

import math
from dataclasses import replace

import numpy as np
import pytest

from app.core.messages import Proposal
from app.core.motion import Motion
from app.recording.read.event_index import Mark
from app.ui.playback import SPEEDS, moment_text
from app.ui.player import FASTEST, STRIDE_S, Player, Reel
from app.ui.replanning import Replanned, ReplanRequest, card, rows
from tests.ui import synthetic

REEL = Reel(
    name="a",
    duration_s=10.0,
    marks=tuple(Mark(time_s=time_s, kind="motion", text=f"motion {time_s:g}") for time_s in (2.0, 5.0, 8.0)),
    models=(),
    clock=lambda time_s: 1000.0 + time_s,
)


def playing(**fields: float) -> Player:
    player = Player(REEL, **fields)
    player.toggle()
    return player


def test_it_begins_paused_with_a_jump_to_where_it_was_asked_to():
    player = Player(REEL, time_s=3.0)
    assert player.advance(1.0)[:4] == (3.0, False, 1.0, True)
    assert not player.advance(1.0).jumped
    assert player.now() == 1003.0
    assert Player(REEL, time_s=99.0).where.time_s == 10.0


@pytest.mark.parametrize("speed", [speed for speed in SPEEDS.values() if speed != FASTEST])
def test_time_passes_at_its_speed_to_the_end_and_there_it_pauses(speed: float):
    player = playing(speed=speed)
    assert player.advance(0.1).time_s == pytest.approx(min(0.1 * speed, 10.0))
    while (where := player.advance(1.0)).playing:
        pass
    assert where.time_s == 10.0


def test_as_fast_as_possible_does_not_look_at_the_clock():
    player = playing(speed=FASTEST)
    assert player.advance(0.0).time_s == STRIDE_S


def test_playing_at_the_end_begins_again():
    player = playing(time_s=10.0)
    assert player.where.time_s == 0.0
    assert player.advance(0.5)[:4] == (0.5, True, 1.0, True)


def test_a_jump_goes_on_from_there_and_stays_within_the_recording():
    player = playing()
    player.advance(0.0)
    player.jump(7.0)
    assert player.advance(0.5)[:4] == (7.5, True, 1.0, True)
    player.jump(-1.0)
    assert player.where.time_s == 0.0


def test_steps_go_from_motion_to_motion_and_pause():
    player = playing()
    moments = list[float]()
    for way in (1, 1, 1, 1, -1, -1, -1):
        player.step(way)
        moments.append(player.where.time_s)
    assert moments == [2.0, 5.0, 8.0, 8.0, 5.0, 2.0, 2.0]
    assert not player.where.playing


def test_what_was_planned_again_is_shown_until_it_goes_on():
    player, again = playing(time_s=4.0), synthetic.proposal(synthetic.rope(0.5))
    player.advance(0.0)
    player.order(ReplanRequest(time_s=4.0))
    player.order(ReplanRequest(time_s=9.0))
    assert player.pending_request() == ReplanRequest(time_s=4.0)
    assert not player.where.playing
    player.jump(9.0)
    player.answer("Planned.", Replanned(then=None, again=again, model="version 1"))
    assert player.pending_request() is None
    where = player.advance(1.0)
    assert (where.time_s, where.jumped, where.besides) == (4.0, True, (again,))
    player.toggle()
    where = player.advance(1.0)
    assert (where.time_s, where.jumped, where.besides) == (5.0, True, ())


def test_an_error_takes_the_place_of_a_plan_and_another_may_be_asked_for():
    player = Player(REEL)
    player.order(ReplanRequest(time_s=0.0))
    player.tell("Compiling.")
    player.answer("No such model.")
    assert (player.said, player.replanned, player.pending_request()) == ("No such model.", None, None)


def moved(proposal: Proposal, by_m: tuple[float, float, float]) -> Proposal:
    motion = Motion(positions=proposal.motion.positions + np.array(by_m), speeds=proposal.motion.speeds)
    return replace(proposal, motion=motion, predicted_chamfer_m2=2e-4)


def test_the_comparison_says_cost_distance_and_how_far_apart_the_motions_begin():
    then = synthetic.proposal(synthetic.rope(0.5))
    found = Replanned(then=then, again=moved(then, (0.03, 0.04, 0.0)), model="a & b.toml")
    assert found.apart_m == pytest.approx(0.05)
    said = {row.name: (row.then, row.again) for row in rows(found)}
    assert said["The motions begin"] == ("", "50 mm apart")
    assert said["Predicted distance"] == ("25.2 mm", "10.0 mm")
    assert said["Model"] == ("version 2", "a & b.toml")
    assert "a &amp; b.toml" in card(found, "Planned in 2 s.")
    assert "Planned in 2 s." in card(found, "Planned in 2 s.")


def test_a_moment_without_a_plan_is_compared_with_none():
    found = Replanned(then=None, again=synthetic.proposal(synthetic.rope(0.5)), model="version 1")
    assert math.isnan(found.apart_m)
    assert all(row.then in ("", "\N{EN DASH}") for row in rows(found))


def test_the_moment_is_said_in_words():
    player = playing(time_s=5.5, speed=2.0)
    assert "<b>5.50 s</b> of 10.00 s" in moment_text(REEL, player.where)
    assert "motion 2 of 3, playing 2\N{MULTIPLICATION SIGN}" in moment_text(REEL, player.where)
