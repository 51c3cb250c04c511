"""Texts of the model monitor: the card of the change detection, and the verdict of a discovery. Pure, as `cards`."""

import math
from collections.abc import Iterable
from html import escape
from typing import Final

from app.core.dialogue import words
from app.core.dialogue.model_monitor_messages import Blamed, Verdict, Watched
from app.ui.parts.cards import table
from app.ui.parts.console_state import ConsoleState

_KINDS: Final = {
    "named": "Something is missing in the model",
    "set": "One of these is missing in the model",
    "none": "Nothing is missing that these data would show",
    "none_of_these": "Something is missing, and it is no known cause",
}
_ROWS = 6
_MOST = 10.0
"""Largest evidence shown, in alarm thresholds."""
_MM = 1e3


def watch(state: ConsoleState) -> str:
    """Card of the change detection: the model's state, the last prediction error, and the suspected causes."""
    seen = state.watched
    if seen is None:
        return '<div class="dp"><small>Watched from the first motion on.</small></div>'
    said, tone = _state(seen)
    parts = [f'<p class="{tone}"><b>{escape(said)}</b></p>', table(_watch_rows(seen))]
    if seen.state == "wrong":
        parts.append(_suspicion_section(seen))
    return f'<div class="dp dp-doubt">{"".join(parts)}</div>'


def _state(seen: Watched) -> tuple[str, str]:
    match seen.state:
        case "learning":
            return f"Learning what is usual, {words.motions(seen.pushes)} so far", ""
        case "right":
            return f"Right so far, {words.motions(seen.pushes)}", "dp-good"
        case "wrong":
            return f"Has stopped being right, it seems since motion {seen.since}", "dp-bad"


def _watch_rows(seen: Watched) -> Iterable[tuple[str, str]]:
    yield "Last motion, off by", f"{_mm(seen.error_m)} <small>of {_mm(seen.moved_m)} moved</small>"
    if math.isfinite(seen.promised_m):
        yield "The model promised", _mm(seen.promised_m)
    if seen.state != "learning":
        limit = f"false in {escape(words.probability(seen.false_alarm))} of sessions at most"
        evidence = _percent(min(seen.evidence, _MOST))
        yield "Evidence against it", f"{evidence} <small title='{limit}'>of an alarm</small>"


def _suspicion_section(seen: Watched) -> str:
    listed = "".join(f"<li>{escape(words.sentence(text))}.</li>" for text in seen.suspicions)
    suspected = f"<ul>{listed}</ul>" if listed else "<p>Nothing stands out.</p>"
    to_know = f"<p>To know, end this session and run</p><code>{escape(seen.advice)}</code>" if seen.advice else ""
    return f"<h3>Suspected</h3>{suspected}{to_know}"


def verdict(state: ConsoleState) -> str:
    """Card of a discovery's verdict: its sentences, the causes by probability, and the motion that it asks for."""
    seen = state.verdict
    if seen is None:
        return (
            '<div class="dp"><small>No verdict was given. <code>dipac discover</code> makes one of recordings, and '
            "<code>dipac console --case DIR</code> shows it here.</small></div>"
        )
    sentences = "".join(f"<p>{escape(text)}</p>" for text in seen.sentences)
    asked = f"<h3>The motion that it asks for</h3><p>{escape(seen.next_push)}</p>" if seen.next_push else ""
    return (
        f'<div class="dp dp-doubt"><p><b>{escape(_KINDS[seen.kind])}</b></p>{sentences}'
        f"<h3>Causes</h3>{_causes(seen)}{asked}<p><small>{escape(seen.source)}</small></p></div>"
    )


def _causes(seen: Verdict) -> str:
    named = {cause.effect for cause in seen.causes}
    others = [cause for cause in seen.ranking if cause.effect not in named]
    rows = [*(_cause(cause, named=True) for cause in seen.causes), *(_cause(it, named=False) for it in others)]
    return table(rows[:_ROWS]) if rows else "<p>None was weighed.</p>"


def _cause(cause: Blamed, *, named: bool) -> tuple[str, str]:
    title = escape(cause.title)
    return (
        f"<b>{title}</b>" if named else title,
        f"{escape(words.probability(cause.probability))}<br><small>{escape(cause.size)}</small>",
    )


def _percent(share: float) -> str:
    if not math.isfinite(share):
        return words.NOTHING
    return f"{100 * share:.0f} %"


def _mm(length_m: float) -> str:
    return f"{length_m * _MM:.1f} mm" if math.isfinite(length_m) else words.NOTHING
