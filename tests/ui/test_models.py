"""Display of models: estimates, differences, and the last motion."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.messages import Model, Parameter
from app.ui.parts.console_state import ConsoleState, Made
from app.ui.tabs import models
from app.ui.tabs.modelling import course, label
from tests.ui import synthetic
from tests.ui.test_console_state import state_after
from tests.ui.test_model_monitor_panel import WATCHED


def version(number: int, stiffness: float, *, spread: float = 0.2) -> Model:
    """A model that estimates a stiffness, keeps friction as told, and knows an effect that does nothing."""
    return replace(
        synthetic.model(number, 5e-5 / (number + 1)),
        parameters=(
            Parameter(
                name="stiffness",
                value=stiffness,
                unit="Pa",
                low=stiffness * (1 - spread),
                high=stiffness * (1 + spread),
            ),
            Parameter(name="table_friction", value=0.4, unit="1", low=0.4, high=0.4),
            Parameter(name="adhesion", value=0.0, unit="Pa", low=0.0, high=0.0),
        ),
    )


def test_what_was_estimated_in_any_version_is_told_and_what_changed():
    first, second = version(0, 2e4, spread=0.0), version(1, 3e4)
    assert models.notable_parameters((first, second)) == ("stiffness",)
    moved = replace(
        second,
        parameters=(*second.parameters[:2], Parameter(name="adhesion", value=5.0, unit="Pa", low=5.0, high=5.0)),
    )
    assert models.notable_parameters((first, moved)) == ("stiffness", "adhesion")


def test_where_nothing_was_estimated_what_is_not_zero_is_told():
    assert models.notable_parameters((version(0, 2e4, spread=0.0),)) == ("stiffness", "table_friction")
    assert models.notable_parameters(()) == ()


def test_the_table_has_value_unit_interval_and_the_change_since_the_version_before():
    state = state_after(version(1, 2e4), version(2, 3e4))
    html = models.parameters(state, rows=models.notable_parameters(state.models))
    assert "3e+04 Pa" in html
    assert "+50 %" in html
    assert "2.4e+04 to 3.6e+04" in html
    assert "friction" not in html
    assert models.parameters(ConsoleState(), rows=()) == ""


def test_the_summary_says_the_version_its_source_its_error_and_whether_another_is_being_made():
    state = state_after(version(3, 2e4))
    assert "Version 3" in models.summary(state)
    assert "from 3 motions, one-step error 2.5 mm" in models.summary(state)
    assert "Calibrating now" not in models.summary(state)
    learning = state.after(replace(synthetic.health(), calibrating=True))
    assert "Calibrating now" in models.summary(learning)
    assert "the task's own guess" in models.summary(state_after(synthetic.model(0, float("nan"))))
    assert "No model yet" in models.summary(ConsoleState())


@pytest.mark.parametrize(("other", "said"), [(2.2e4, "intervals overlap"), (6e4, "intervals apart")])
def test_two_versions_stand_side_by_side_with_the_change_and_whether_intervals_overlap(other: float, said: str):
    html = models.compare(version(1, 2e4), version(2, other))
    assert "version 1" in html
    assert "version 2" in html
    assert f"{100 * (other / 2e4 - 1):+.0f} %" in html
    assert said in html
    assert "intervals" not in models.compare(version(1, 2e4, spread=0.0), version(2, other))


def test_a_parameter_that_one_version_lacks_is_left_empty_there():
    erring = replace(
        version(2, 2e4),
        apparatus=(Parameter(name="depth_bias", value=0.002, unit="m", low=0.001, high=0.003),),
    )
    html = models.compare(version(1, 2e4), erring)
    assert "depth bias" in html
    assert "<td>\N{EN DASH}</td>" in html


def test_the_last_motion_is_told_in_numbers_and_drawn_from_above():
    proposal = synthetic.proposal(synthetic.rope(0.5))
    state = state_after(proposal, synthetic.transition(synthetic.rope(0.5), synthetic.rope(0.2)), WATCHED)
    html = models.last_motion(state.after(synthetic.outcome(1)))
    assert "3.4 mm <small>of 22.0 mm moved" in html
    assert "To the goal, seen" in html
    assert html.count("<g ") == 3
    assert "After the first motion" in models.last_motion(ConsoleState())


def test_from_above_the_table_s_x_is_up_and_its_y_left():
    far_left, near_right = np.array([[[0.7, 0.2, 0.0]], [[0.5, -0.1, 0.0]]], np.float32)
    html = models.top_view(Made(before=far_left, expected=near_right, after=near_right))
    first, second = (html.split("<circle ")[index].split(" r=")[0] for index in (1, 2))
    assert first == 'cx="8.0" cy="8.0"'
    assert second == 'cx="292.0" cy="197.3"'


def test_names_from_outside_are_escaped():
    bad = replace(version(1, 2e4), parameters=(Parameter(name="<b>", value=1.0, unit="<i>", low=0.5, high=2.0),))
    for html in (models.compare(bad, bad), models.parameters(state_after(bad), rows=("<b>",))):
        assert "<i>" not in html
        assert "<b>" not in html


def test_a_parameter_s_course_is_in_the_order_of_the_versions():
    number, value, low, high = course((version(2, 3e4), version(1, 2e4)), "stiffness")
    np.testing.assert_allclose(number, [1, 2])
    np.testing.assert_allclose(value, [2e4, 3e4])
    np.testing.assert_allclose(low, [1.6e4, 2.4e4])
    np.testing.assert_allclose(high, [2.4e4, 3.6e4])
    assert len(course((), "stiffness")[0]) == 0
    assert label(version(2, 3e4)) == "version 2, 2.9 mm"
