"""The terminal prints what messages say as it is, in lines of 80 characters whose columns stand below their titles."""

import io

import pytest
from rich.console import Console

from app.core.messages import Fault, Message, Notice, Outcome
from app.ui.terminal import Terminal, outcome_line


def printed(*messages: Message) -> list[str]:
    output = io.StringIO()
    with Terminal(Console(file=output, width=80)) as terminal:
        for message in messages:
            terminal.show(message)
    return output.getvalue().splitlines()


def an_outcome(index: int = 1, chamfer_m2: float = 2e-4) -> Outcome:
    return Outcome(
        id="outcome-1",
        time_s=0.0,
        index=index,
        chamfer_before_m2=chamfer_m2,
        predicted_chamfer_m2=chamfer_m2,
        chamfer_after_m2=chamfer_m2,
        cost_before=0.123,
        cost_after=0.045,
        plan_s=12.3,
        model_version=3,
    )


@pytest.mark.parametrize("kind", [Notice, Fault])
def test_brackets_and_colons_in_a_message_are_not_markup(kind: type[Notice] | type[Fault]):
    text = "too close [/] edge, [red]left[/red] :warning:"
    _, line = printed(kind(id="message-1", time_s=0.0, where="arm [/]", text=text))
    assert line.endswith(f"arm [/]: {text}")


@pytest.mark.parametrize("outcome", [an_outcome(), an_outcome(index=9999, chamfer_m2=1.9)])
def test_a_push_and_the_header_fit_80_characters(outcome: Outcome):
    header, line = printed(outcome)
    assert line == outcome_line(outcome)
    assert max(len(header), len(line)) <= 80


def test_each_title_ends_where_its_column_does():
    header, line = printed(an_outcome())
    for title, value in (
        ("push", "   1"),
        ("distance to goal", "10.0 ->  10.0 mm"),
        ("predicted", " 10.0 mm"),
        ("cost, descent [1e-3]", "123.00 ->   45.00"),
        ("plan", "12.3 s"),
    ):
        end = header.index(title) + len(title)
        assert line[:end].endswith(value)
    assert line[header.index("model") :] == "v3"
