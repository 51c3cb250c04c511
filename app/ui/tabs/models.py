"""The texts about models as HTML: their parameters, the differences of two, and the last motion and its prediction.

Pure, as `cards`.
"""

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Final

from app.core.dialogue import words
from app.core.messages import Model, Parameter
from app.ui.parts import palette
from app.ui.parts.cards import table
from app.ui.parts.console_state import ConsoleState, Made

_MM: Final = 1e3
_PICTURE_WIDTH, _MARGIN = 300.0, 8.0
_DOTS = 250
"""Points of each cloud in the picture: more would not be told apart."""


def summary(state: ConsoleState) -> str:
    """Card of the version in use, its source, and a calibration under way."""
    model = state.model
    if model is None:
        return '<div class="dp"><small>No model yet.</small></div>'
    source = f"from {_motions(model.transition_count)}" if model.transition_count else "the task's own guess"
    loss = f", one-step error {words.distance(model.loss_m2)}" if math.isfinite(model.loss_m2) else ""
    learning = state.health is not None and state.health.calibrating
    now = "<p class='dp-good'><b>Calibrating now</b></p>" if learning else ""
    return f'<div class="dp"><p><b>Version {model.version}</b> in use: {source}{loss}.</p>{now}</div>'


def parameters(state: ConsoleState, *, rows: Sequence[str]) -> str:
    """The parameters `rows` of the model in use: values, 90 % intervals, and the change from the version before."""
    if state.model is None:
        return ""
    before = state.models[-2] if len(state.models) > 1 else None
    return f'<div class="dp">{table(_parameter_rows(state.model, before, rows))}</div>'


def _parameter_rows(model: Model, before: Model | None, names: Sequence[str]) -> Iterable[tuple[str, str]]:
    for name in names:
        now, then = parameter(model, name), parameter(before, name) if before else None
        if now is not None:
            changed = _change(then, now) if then is not None and then.value != now.value else ""
            yield spelt(name), f"{_value(now)}{f' <em>{changed}</em>' if changed else ''}{_interval(now)}"


def notable_parameters(models: Sequence[Model]) -> tuple[str, ...]:
    """Names of the parameters estimated or changed in any of these models; else of those that are not zero."""
    entries = [(each, model) for model in models for each in (*model.parameters, *model.apparatus)]
    names = tuple(dict.fromkeys(each.name for each, _ in entries))
    values = {name: {each.value for each, _ in entries if each.name == name} for name in names}
    estimated = {each.name for each, _ in entries if each.low < each.high}
    learnt = tuple(name for name in names if name in estimated or len(values[name]) > 1)
    return learnt or tuple(name for name in names if values[name] != {0.0})


def parameter(model: Model, name: str) -> Parameter | None:
    """The parameter of that name; None where this model has none."""
    return next((each for each in (*model.parameters, *model.apparatus) if each.name == name), None)


def compare(one: Model, other: Model) -> str:
    """Both versions side by side: values, the change in per cent, and the overlap of their intervals."""
    names = notable_parameters((one, other))
    head = f"<tr><td></td><td>version {one.version}</td><td>version {other.version}</td><td></td></tr>"
    rows = "".join(_compared_row(name, parameter(one, name), parameter(other, name)) for name in names)
    losses = (
        f"<tr><td>one-step error</td><td>{words.distance(one.loss_m2)}</td><td>{words.distance(other.loss_m2)}</td>"
        f"<td>{words.change(words.millimetres(one.loss_m2), words.millimetres(other.loss_m2))}</td></tr>"
    )
    return f'<div class="dp"><table class="dp-side">{head}{rows}{losses}</table></div>'


def _compared_row(name: str, one: Parameter | None, other: Parameter | None) -> str:
    cells = "".join(f"<td>{_value(each) + _interval(each) if each else words.NOTHING}</td>" for each in (one, other))
    said = f"{_change(one, other)}<br><small>{_overlap(one, other)}</small>" if one and other else ""
    return f"<tr><td>{spelt(name)}</td>{cells}<td>{said}</td></tr>"


def _overlap(one: Parameter, other: Parameter) -> str:
    """Note on the overlap of the 90 % intervals, where both are estimates."""
    if not (one.low < one.high and other.low < other.high):
        return ""
    return "intervals overlap" if one.low <= other.high and other.low <= one.high else "intervals apart"


def _change(before: Parameter, after: Parameter) -> str:
    return words.change(before.value, after.value) or ("" if before.value == after.value else "changed")


def last_motion(state: ConsoleState) -> str:
    """Card of the last motion's prediction error, with a picture of it from above."""
    if state.made is None:
        return '<div class="dp"><small>After the first motion.</small></div>'
    seen = state.watched
    numbers = (
        [("Off by", f"{_MM * seen.error_m:.1f} mm <small>of {_MM * seen.moved_m:.1f} mm moved</small>")] if seen else []
    )
    if state.outcomes:
        last = state.outcomes[-1]
        predicted, came = words.distance(last.predicted_chamfer_m2), words.distance(last.chamfer_after_m2)
        numbers.append(("To the goal, predicted", predicted))
        numbers.append(("To the goal, seen", came))
    return f'<div class="dp">{table(numbers)}{top_view(state.made)}{_legend()}</div>'


def top_view(made: Made) -> str:
    """The object from above, in the table's x (up) and y (left): before, as expected, as observed."""
    clouds = [cloud[:: max(len(cloud) // _DOTS, 1)] for cloud in (made.before, made.expected, made.after)]
    corners = [(cloud.min(axis=0), cloud.max(axis=0)) for cloud in clouds if len(cloud)]
    if not corners:
        return ""
    low = [float(min(corner[0][axis] for corner in corners)) for axis in (0, 1)]
    high = [float(max(corner[1][axis] for corner in corners)) for axis in (0, 1)]
    scale = (_PICTURE_WIDTH - 2 * _MARGIN) / max(high[0] - low[0], high[1] - low[1], 1e-3)
    size = [scale * (high[axis] - low[axis]) + 2 * _MARGIN for axis in (0, 1)]
    circles = "".join(
        f'<g fill="rgb{colour}" fill-opacity="{opacity}">'
        + "".join(
            f'<circle cx="{_MARGIN + scale * (high[1] - y):.1f}" cy="{_MARGIN + scale * (high[0] - x):.1f}" r="2"/>'
            for x, y in cloud[:, :2].tolist()
        )
        + "</g>"
        for cloud, colour, opacity in zip(clouds, _COLOURS, (0.35, 0.9, 0.9), strict=True)
    )
    return (
        f'<svg class="dp-top" role="img" aria-label="The last motion from above" width="{size[1]:.0f}" '
        f'height="{size[0]:.0f}" viewBox="0 0 {size[1]:.1f} {size[0]:.1f}">{circles}</svg>'
    )


_COLOURS: Final = (palette.OUTLINE, palette.EXPECTED, palette.OBSERVED)


def _legend() -> str:
    named = zip(("before", "as predicted", "as seen"), _COLOURS, strict=True)
    return (
        '<div class="dp-key">'
        + "".join(f"<span style='--c:rgb{colour}'>{word}</span>" for word, colour in named)
        + "</div>"
    )


def spelt(name: str) -> str:
    """A parameter's name in words."""
    return escape(name.replace("_", " "))


def _value(each: Parameter) -> str:
    unit = f" {escape(each.unit)}" if each.unit not in ("", "1") else ""
    return f"{words.number(each.value)}{unit}"


def _interval(each: Parameter) -> str:
    if not each.low < each.high:
        return ""
    return f"<br><small>{words.number(each.low)} to {words.number(each.high)}</small>"


def _motions(count: int) -> str:
    return "1 motion" if count == 1 else f"{count} motions"
