"""Drift of the object since the plan was made, as the card shows it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from app.config import Timing
from app.core.dialogue.approval import drift
from app.ui.parts import cards
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.drift import DriftMeter, Moved
from tests.ui import synthetic

PROPOSAL = synthetic.proposal(synthetic.rope(0.5))


def test_it_is_what_the_gate_will_look_at_while_a_plan_is_pending_and_nothing_otherwise() -> None:
    since = DriftMeter(Timing()).since
    moved = synthetic.particles(synthetic.rope(0.5, centre=(0.556, 0.0)))
    state = ConsoleState().after(moved)
    assert math.isnan(since(state).drift_m)
    state = state.after(PROPOSAL)
    expected_m = drift(PROPOSAL.observed, moved.positions)
    assert expected_m > 0.001
    assert since(state).drift_m == since(state).drift_m == pytest.approx(expected_m)
    back = state.after(synthetic.particles(PROPOSAL.observed))
    assert since(back).drift_m == 0.0
    gone = back.after(replace(synthetic.notice("plan", "grew too old"), cause=(PROPOSAL.id,)))
    assert math.isnan(since(gone).drift_m)


@pytest.mark.parametrize(("drift_m", "tone"), [(0.001, ""), (0.005, "dp-warn"), (0.009, "dp-bad"), (np.nan, None)])
def test_the_card_says_how_much_of_what_is_allowed(drift_m: float, tone: str | None) -> None:
    moved = Moved(drift_m=float(drift_m), max_drift_m=0.008, max_age_s=300.0)
    shown = cards.plan(ConsoleState().after(PROPOSAL), PROPOSAL.time_s + 12, moved)
    assert "12 s <small>of 5 min 0 s" in shown
    if tone is None:
        assert "Object moved since" not in shown
    else:
        text = f"{drift_m * 1e3:.1f} mm"
        assert (f'<span class="{tone}">{text}</span>' if tone else text) in shown
        assert "of 8 mm" in shown


def test_why_a_plan_came_to_nothing_stays_on_its_card_until_the_next() -> None:
    said = replace(synthetic.notice("approval", "The object has moved by 12 mm <since>."), cause=(PROPOSAL.id,))
    state = ConsoleState().after(PROPOSAL).after(said)
    for index in range(20):
        state = state.after(synthetic.notice("planner", f"something else {index}"))
    assert "The object has moved by 12 mm &lt;since&gt;." in cards.plan(state, 0.0)
    assert "12 mm" not in cards.plan(state.after(synthetic.proposal(synthetic.rope(0.4))), 0.0)
