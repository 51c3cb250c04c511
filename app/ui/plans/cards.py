"""The texts of the tab Plans as HTML. Pure, as `app.ui.parts.cards`."""

from collections.abc import Iterable
from html import escape
from typing import Final

from app.core.dialogue import words
from app.core.messages import Branch, Proposal
from app.core.types import Points
from app.ui.parts.cards import table
from app.ui.plans.look import PreviewState, motion_at, names, to_goal_m2

NO_PLAN: Final = '<div class="dp"><small>No plan yet.</small></div>'


def branches(proposal: Proposal, look: PreviewState) -> str:
    """All branches of a plan with their costs before and after descent, and the cost terms on hovering."""
    head = "<tr><th>Branch</th><th>Cost</th><th></th></tr>"
    rows = "".join(_row(proposal, look, index) for index in range(len(proposal.branches)))
    return f'<div class="dp dp-plans"><table>{head}{rows}</table>{_hint(proposal)}</div>'


def _hint(proposal: Proposal) -> str:
    kept = "The cheapest that may be made is proposed. Hover over a line for its terms."
    made = "You made the first; it is proposed whatever it costs. Hover over a line for its terms."
    return f"<small>{made if proposal.chosen.origin == 'edited' else kept}</small>"


def _row(proposal: Proposal, look: PreviewState, index: int) -> str:
    branch = proposal.branches[index]
    kinds = {"best": index == proposal.best, "looked": index == look.at, "compared": index == look.beside}
    classes = " ".join(f"dp-{kind}" for kind, holds in kinds.items() if holds)
    name = escape(names(proposal)[index]) + (" <small>proposed</small>" if index == proposal.best else "")
    if not branch.finite:
        return f"<tr class='{classes} dp-dropped'><td>{name}</td><td colspan='2'>dropped: not finite</td></tr>"
    cost = f"<td>{_cost(branch)}</td><td>{_change(branch)}</td>"
    return f"<tr class='{classes}' title='{_terms(branch)}'><td>{name}</td>{cost}</tr>"


def _cost(branch: Branch) -> str:
    if branch.cost_before == branch.cost_after:
        return words.number(branch.cost_after)
    return f"{words.number(branch.cost_before)} → {words.number(branch.cost_after)}"


def _change(branch: Branch) -> str:
    """Gain of the descent; costs may be negative, so it is a difference and no share."""
    gained = branch.cost_after - branch.cost_before
    return f"<small>{words.number(gained)}</small>" if gained else ""


def _terms(branch: Branch) -> str:
    said = [f"{name}: {words.number(value)}" for name, value in branch.terms.items()]
    return escape("; ".join(said) or "no terms", quote=True)


def moment(look: PreviewState, goal: Points | None) -> str:
    """Card of the chosen moment of the branches, with the object's distance from the goal."""
    return f'<div class="dp dp-moment">{table(_moment_rows(look, goal))}</div>'


def _moment_rows(look: PreviewState, goal: Points | None) -> Iterable[tuple[str, str]]:
    if not look.share:
        yield "Moment", "now"
    else:
        number, count = motion_at(look.branch, look.share)
        when = "the end" if look.share == 1 else f"{100 * look.share:.0f} %"
        yield "Moment", f"{when} <small>in motion {number} of {count}</small>"
    called = names(look.proposal)
    for index, branch, colour in ((look.at, look.branch, "looked"), (look.beside, look.other, "compared")):
        if index is not None and branch is not None:
            far = words.NOTHING if goal is None else words.distance(to_goal_m2(look.ghost(branch), goal))
            yield f"<span class='dp-{colour}'>{escape(called[index])}</span>", f"{far} <small>to the goal</small>"
