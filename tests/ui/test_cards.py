"""Cards of the panel: their words and numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.dialogue import words
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Message
from app.ui.parts import cards
from app.ui.parts.console_state import ConsoleState
from tests.ui import synthetic


def state_after(*messages: Message) -> ConsoleState:
    state = ConsoleState()
    for message in messages:
        state = state.after(message)
    return state


def all_cards(state: ConsoleState) -> str:
    now_s = state.health.time_s if state.health else 0.0
    dated = (cards.mode, cards.plan, cards.health, cards.log)
    return "".join(card(state, now_s) for card in dated) + cards.episode(state)


@given(st.text(min_size=1))
def test_no_word_from_outside_becomes_markup(text):
    hostile = f"<img src=x onerror=alert(1)>{text}"
    shown = all_cards(
        state_after(
            replace(synthetic.episode(), rig=hostile, code_version=hostile),
            replace(synthetic.model(1, 1e-5), parameters=()),
            synthetic.notice(hostile, hostile),
            replace(
                synthetic.health(doing=hostile),
                frame_age_s={hostile: 0.1},
                drops={hostile: 1},
                cameras={hostile: hostile},
            ),
        )
    )
    assert "<img" not in shown


def test_the_plan_card_shows_what_was_predicted_and_what_descent_gained():
    proposal = synthetic.proposal(synthetic.rope(0.5))
    shown = cards.plan(state_after(proposal), proposal.time_s + 12.0)
    assert words.distance(proposal.chamfer_m2) in shown
    assert words.distance(proposal.predicted_chamfer_m2) in shown
    assert f"{words.number(proposal.chosen.cost_before)} → {words.number(proposal.chosen.cost_after)}" in shown
    assert "12 s" in shown
    assert "1 non-finite" in shown
    assert proposal.motion.digest()[:12] in shown
    assert "waiting for a decision" in shown


@pytest.mark.parametrize(
    ("messages", "says"),
    [
        ((), "Waiting for the cameras"),
        (
            (synthetic.health("planning (3 s)"), synthetic.frame(synthetic.camera("left", 0), synthetic.rope(0))),
            "Planning (3 s)",
        ),
        ((synthetic.proposal(synthetic.rope(0.5)),), "Waiting for your approval"),
        ((synthetic.arm("stopped"), synthetic.proposal(synthetic.rope(0.5))), "Stopped"),
        ((synthetic.arm("fault"),), "Fault at the arm"),
    ],
)
def test_the_mode_line_says_in_words_what_goes_on(messages, says):
    state = state_after(*messages)
    now_s = max((message.time_s for message in messages), default=0.0)
    assert says in cards.mode(state, now_s)


def test_silence_of_the_program_is_said_even_while_a_plan_is_up():
    health = synthetic.health()
    state = state_after(health, synthetic.proposal(synthetic.rope(0.5)))
    assert "Waiting for your approval" in cards.mode(state, health.time_s + 1)
    assert "No news for 10 s" in cards.mode(state, health.time_s + 10)


def test_ages_go_on_counting_while_no_report_comes():
    health = replace(synthetic.health(), frame_age_s={"left": 0.5})
    assert "0.5 s" in cards.health(state_after(health), health.time_s)
    late = cards.health(state_after(health), health.time_s + 20)
    assert '<span class="dp-bad">20 s</span>' in late


def test_what_is_wrong_with_a_camera_stands_below_its_age():
    health = replace(synthetic.health(), frame_age_s={"left": 7.0, "right": 0.1}, cameras={"left": "it is reset"})
    rows = cards.health(state_after(health), health.time_s)
    assert rows.index("Camera left") < rows.index("it is reset") < rows.index("Camera right")


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.08, "80 ms"),
        (0.0999, "0.1 s"),
        (2.44, "2.4 s"),
        (9.96, "10 s"),
        (59.4, "59 s"),
        (59.6, "1 min 0 s"),
        (185.0, "3 min 5 s"),
        (math.inf, words.NOTHING),
        (math.nan, words.NOTHING),
    ],
)
def test_durations_in_words(seconds, said):
    assert words.duration(seconds) == said


def test_a_distance_is_the_drift_that_moves_every_point_by_that_much():
    points = synthetic.rope(0.0).astype(float)
    shift_m = 1e-4
    moved = points + np.array([0.0, 0.0, shift_m])
    assert words.millimetres(float(chamfer_m2(points, moved))) == pytest.approx(shift_m * 1e3, rel=1e-6)


def test_the_mode_card_names_the_mode_for_scripts_and_a_page_its_key():
    assert "teleoperate" not in cards.mode(ConsoleState(), 0.0)
    assert 'data-mode="teleoperate"' in cards.mode(state_after(synthetic.mode("teleoperate")), 0.0)
    assert 'data-key="abc-_"' in cards.you("client 0", "abc-_")
    assert "data-key" not in cards.you("client 0")
