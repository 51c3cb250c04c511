"""Display of a model that may be wrong: the model monitor's card, and the tab with the verdict."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.dialogue import words
from app.core.dialogue.model_monitor_messages import Blamed, Verdict, Watched
from app.core.messages import Transition, fresh_id
from app.ui.parts import cards
from app.ui.parts.console_state import ConsoleState
from app.ui.tabs import model_monitor_panel
from tests.ui import synthetic
from tests.ui.test_console_state import state_after

WATCHED = Watched(
    id=fresh_id("watched"),
    time_s=1.0,
    pushes=7,
    state="right",
    since=0,
    evidence=0.03,
    false_alarm=0.01,
    error_m=0.0034,
    moved_m=0.022,
    promised_m=0.004,
)
WRONG = replace(
    WATCHED,
    state="wrong",
    since=5,
    evidence=1.2,
    suspicions=("contact or table: the object ends 4.1 mm less far along the push than predicted",),
    advice="dipac discover recordings/a.mcap -o discovery",
)
FILM = Blamed(effect="viscous_film", title="Viscous film", family="physics", size="5.1 /s (3 to 7)", probability=0.55)
VERDICT = Verdict(
    id=fresh_id("verdict"),
    time_s=1.0,
    source="discovery/verdict.json",
    kind="set",
    sentences=("The model lacks one of two kinds of friction.",),
    causes=(FILM, replace(FILM, effect="stribeck", title="Stribeck friction", probability=0.4)),
    ranking=(FILM, replace(FILM, effect="table_tilt", title="Table tilt", probability=0.02)),
    next_push="Push 10 cm at 0.20 m/s",
)


@pytest.mark.parametrize(
    ("watched", "says"),
    [
        (None, "Watched from the first motion on"),
        (replace(WATCHED, state="learning", pushes=1), "Learning what is usual, 1 motion so far"),
        (WATCHED, "Right so far, 7 motions"),
        (WATCHED, "3.4 mm"),
        (WATCHED, "false in 1 % of sessions at most"),
        (WRONG, "Has stopped being right, it seems since motion 5"),
        (WRONG, "Contact or table: the object ends 4.1 mm less far"),
        (WRONG, "dipac discover recordings/a.mcap"),
        (replace(WRONG, suspicions=()), "Nothing stands out"),
    ],
)
def test_the_card_says_how_the_model_does(watched: Watched | None, says: str) -> None:
    assert says in model_monitor_panel.watch(ConsoleState(watched=watched))


def test_what_the_model_promised_is_said_where_it_promised_something() -> None:
    assert "promised" in model_monitor_panel.watch(ConsoleState(watched=WATCHED))
    assert "promised" not in model_monitor_panel.watch(ConsoleState(watched=replace(WATCHED, promised_m=float("nan"))))


def test_the_verdict_shows_its_own_causes_first_and_each_once() -> None:
    shown = model_monitor_panel.verdict(state_after(VERDICT))
    places = [shown.index(title) for title in ("Viscous film", "Stribeck friction", "Table tilt")]
    assert places == sorted(places)
    assert shown.count("Viscous film") == 1
    assert "Push 10 cm at 0.20 m/s" in shown
    assert "55 %" in shown


def test_without_a_verdict_the_tab_says_how_to_get_one() -> None:
    assert "dipac console --case" in model_monitor_panel.verdict(ConsoleState())


@given(st.text(min_size=1))
def test_no_word_of_a_verdict_or_a_watch_becomes_markup(text: str) -> None:
    hostile = f"<img src=x onerror=alert(1)>{text}"
    cause = replace(FILM, title=hostile, size=hostile)
    verdict = replace(
        VERDICT, sentences=(hostile,), causes=(cause,), ranking=(cause,), next_push=hostile, source=hostile
    )
    watched = replace(WRONG, suspicions=(hostile,), advice=hostile)
    state = ConsoleState(watched=watched, verdict=verdict)
    assert "<img" not in model_monitor_panel.watch(state) + model_monitor_panel.verdict(state)


def test_where_the_last_push_was_to_end_is_shown_until_the_next_one_is_approved() -> None:
    proposal = synthetic.proposal(synthetic.rope(0.5))
    executed = synthetic.executed(proposal.motion.positions)
    made = Transition(
        id=fresh_id("transition"), time_s=2.0, before=proposal.observed, executed=executed, after=proposal.observed
    )
    state = state_after(proposal, executed)
    assert state.expected is None
    state = state.after(made)
    assert state.expected is proposal.chosen.predicted
    assert state.ahead is None
    following = synthetic.proposal(synthetic.rope(0.4), seed=1)
    state = state.after(following)
    assert state.expected is proposal.chosen.predicted
    assert state.ahead is following.chosen.predicted


def test_a_push_that_was_asked_for_is_called_one_and_has_no_cost() -> None:
    plain = synthetic.proposal(synthetic.rope(0.5), branches=1)
    branch = replace(plain.branches[0], origin="asked", cost_before=np.nan, cost_after=np.nan, terms={})
    asked = replace(plain, branches=(branch,), best=0)
    state = state_after(asked)
    assert words.origin(asked) in cards.plan(state, asked.time_s)
    assert "Cost" not in cards.plan(state, asked.time_s)
    assert "finding out what the model lacks" in cards.mode(state, asked.time_s)
