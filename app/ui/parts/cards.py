"""The texts of the panel as HTML: state in, string out. Pure. All external text is escaped."""

import math
from collections.abc import Iterable
from html import escape
from typing import Literal, TypeAlias

from app.core.dialogue import words
from app.core.dialogue.requests import is_requested
from app.core.messages import Fault, Health, Model, Parameter, Proposal
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.drift import Moved

_FAR = 0.5
"""Share of the allowed motion of an object, before its plan is refused, that deserves attention."""
Tone: TypeAlias = Literal["", "ask", "go", "bad"]

_SILENCE_S = 3.0
"""Time without a health message, which comes twice a second, after which the program counts as unwell."""
_FRAME_LATE_S, _FRAME_LOST_S = 1.0, 5.0
_ARM_PERIOD_LATE_S = 0.030
_DISK_LOW_BYTES, _DISK_OUT_BYTES = 5e9, 1e9


def mode(state: ConsoleState, now_s: float) -> str:
    """Card of the program's current activity, in words, and of the action that it needs from the operator."""
    said, detail, tone = _mode(state, now_s)
    now, named = state.mode_now or "", escape(mode_name(state))
    return (
        f'<div class="dp-mode {tone}" role="status" data-mode="{now}" data-said="{named}"><i>{named}</i>'
        f"<b>{escape(said)}</b><span>{escape(detail)}</span></div>"
    )


def _mode(state: ConsoleState, now_s: float) -> tuple[str, str, Tone]:
    if state.replay:
        return _replay_activity(state)
    health = state.health
    doing = words.sentence(health.doing) if health else "Starting"
    if state.fatal is not None:
        return "Fault: the program has ended", state.fatal.text, "bad"
    if state.arm_mode == "fault":
        return "Fault at the arm", (state.arm.reason if state.arm else "") or "Resume lifts it.", "bad"
    if state.is_stopped:
        why = f"{state.arm.reason} " if state.arm and state.arm.reason else ""
        return "Stopped", f"{why}The arm holds still. Clear the workspace, then press Resume.", "bad"
    if health is not None and now_s - health.time_s > _SILENCE_S:
        return f"No news for {words.duration(now_s - health.time_s)}", f"It was: {doing}. STOP still works.", "bad"
    if not state.is_cleared:
        return "The checklist comes first", "Nothing moves before it is complete: it is below.", "ask"
    if state.mode_now == "plan only" and state.pending is not None:
        return "A plan to look at", "Nothing moves in this mode.", ""
    if state.pending is not None and state.decidable:
        return "Waiting for your approval", _to_decide(state.pending), "ask"
    if health is None and not state.frames:
        return "Waiting for the cameras", "Nothing has come in yet.", ""
    if state.arm_mode == "moving":
        return doing, "The arm moves.", "go"
    if state.mode is not None and state.mode.mode == "idle" and state.mode.why:
        return doing, f"{words.sentence(state.mode.why)}.", ""
    return doing, _latest_notice(state), ""


def mode_name(state: ConsoleState) -> str:
    """Mode of operation, in two words."""
    if state.mode_now == "fault":
        return "Fault"
    if state.mode is None:
        return ""
    name = words.MODES[state.mode.mode]
    return f"{name}: {words.motions(state.mode.motions)} more" if state.mode.mode == "automatic" else name


def _replay_activity(state: ConsoleState) -> tuple[str, str, Tone]:
    """Activity of the program at that time, which needs no action now."""
    doing = words.sentence(state.health.doing) if state.health else "Recorded without a word on what was being done"
    if state.fatal is not None:
        return "Fault: the program had ended", state.fatal.text, "bad"
    if state.is_stopped:
        return "Stopped", (state.arm.reason if state.arm else "") or doing, "bad"
    if state.arm_mode == "moving":
        return doing, "The arm was moving.", "go"
    said = state.log[-1].text if state.log else ""
    return doing, "A plan was up for approval." if state.pending else said, ""


def _to_decide(pending: Proposal) -> str:
    if pending.chosen.origin == "asked":
        return "This motion is for finding out what the model lacks. Rejected, it does not come again."
    if is_requested(pending):
        return f"This is {words.origin(pending)}. Rejected, what was asked for is given up."
    return "Look at the plan, then approve or reject it."


def _latest_notice(state: ConsoleState) -> str:
    return state.log[-1].text if state.log else "Nothing to decide."


def you(name: str, key: str = "") -> str:
    """Card with a browser's name; with the key that identifies it on other connections."""
    known = f' data-key="{escape(key)}"' if key else ""
    return f'<div class="dp"{known}><small>You are <b>{escape(name)}</b>.</small></div>'


def control(state: ConsoleState) -> str:
    """Card of the operator in control; anybody may stop."""
    if state.replay:
        return "<div class='dp'><small>Nothing can move, and nobody needs control.</small></div>"
    if state.holder:
        said = f"<b>{escape(state.holder)}</b> has control; all others watch."
    else:
        said = "Nobody has control; deciding takes it."
    return f"<div class='dp'><small>{said} STOP is everybody's.</small></div>"


def plan(state: ConsoleState, now_s: float, moved: Moved | None = None) -> str:
    """Card of the plan that is shown; `moved`: motion of the object since."""
    proposal = state.shown
    if proposal is None:
        return '<div class="dp"><small>No plan yet.</small></div>'
    undecided = "not decided on" if state.replay else "waiting for a decision"
    status = undecided if state.pending is proposal else "decided"
    change = words.change(words.millimetres(proposal.chamfer_m2), words.millimetres(proposal.predicted_chamfer_m2))
    tone = "dp-good" if proposal.predicted_chamfer_m2 < proposal.chamfer_m2 else "dp-warn"
    big = (
        f'<div class="dp-big"><b>{words.distance(proposal.chamfer_m2)}</b><i>→</i>'
        f"<b>{words.distance(proposal.predicted_chamfer_m2)}</b><em class='{tone}'>{change}</em></div>"
    )
    return f'<div class="dp">{_said_of(state)}{big}{table(_plan_rows(proposal, status, now_s, moved))}</div>'


def _said_of(state: ConsoleState) -> str:
    """Status of the plan or of its edit, in words."""
    if state.edit is not None:
        return '<p class="dp-refusal">The motion as you changed it is being simulated.</p>'
    return f'<p class="dp-refusal dp-warn">{escape(state.refusal.text)}</p>' if state.refusal else ""


def _plan_rows(proposal: Proposal, status: str, now_s: float, moved: Moved | None) -> Iterable[tuple[str, str]]:
    best = proposal.chosen
    squares = f"{words.square(proposal.chamfer_m2)} → {words.square(proposal.predicted_chamfer_m2)}"
    cost = f"{words.number(best.cost_before)} → {words.number(best.cost_after)}"
    yield "Chamfer, squared", squares
    if math.isfinite(best.cost_after):
        yield "Cost, before → after descent", f"{cost} <small>{words.change(best.cost_before, best.cost_after)}</small>"
    for name, value in best.terms.items():
        yield f"· {escape(name)}", words.number(value)
    yield "State", status
    yield "Chosen", words.origin(proposal)
    if proposal.dropped_count:
        yield "Branches dropped", f"<span class='dp-warn'>{proposal.dropped_count} non-finite</span>"
    ahead = ", made ahead" if proposal.ahead else ""
    yield "Planned in", words.duration(proposal.plan_s) + ahead
    age_s, limit = now_s - proposal.time_s, f"of {words.duration(moved.max_age_s)}" if moved else ""
    yield "Age", f"{words.duration(age_s)} <small>{limit}</small>"
    if moved and math.isfinite(moved.drift_m):
        far = in_colour(f"{moved.drift_m * 1e3:.1f} mm", moved.share > _FAR, moved.share > 1)
        yield "Object moved since", f"{far} <small>of {moved.max_drift_m * 1e3:.0f} mm</small>"
    yield "Model", f"version {proposal.model_version}"
    yield "Motion", f"<small title='{proposal.motion.digest()}'>{proposal.motion.digest()[:12]}</small>"


def health(state: ConsoleState, now_s: float) -> str:
    """The health strip: ages, times, losses and drops, each coloured by its state."""
    seen = state.health
    if seen is None:
        return '<div class="dp"><small>No report yet.</small></div>'
    silent_s = max(now_s - seen.time_s, 0.0)
    return f'<div class="dp">{table(_health_rows(seen, state.model, silent_s))}</div>'


def _health_rows(seen: Health, model: Model | None, silent_s: float) -> Iterable[tuple[str, str]]:
    for name, age_s in seen.frame_age_s.items():
        age_s += silent_s
        yield (
            f"Camera {escape(name)}",
            in_colour(words.duration(age_s), age_s > _FRAME_LATE_S, age_s > _FRAME_LOST_S),
        )
        if said := seen.cameras.get(name):
            yield "", in_colour(escape(said), True, age_s > _FRAME_LOST_S)
    age_s = seen.particles_age_s + silent_s
    yield "Particles", in_colour(words.duration(age_s), age_s > 2 * _FRAME_LATE_S, age_s > 2 * _FRAME_LOST_S)
    yield "Plan age, time", f"{words.duration(seen.plan_age_s + silent_s)}, {words.duration(seen.plan_s)}"
    late = seen.arm_period_s > _ARM_PERIOD_LATE_S
    mode = in_colour(seen.arm_mode, seen.arm_mode in ("stopping", "stopped"), seen.arm_mode == "fault")
    yield "Arm, longest period", f"{mode}, {in_colour(words.duration(seen.arm_period_s), late, False)}"
    yield "Model, loss", f"v{seen.model_version}, {words.square(seen.calibration_loss_m2)}"
    for parameter in filter(_is_informative, (*model.parameters, *model.apparatus) if model else ()):
        yield f"· {escape(parameter.name.replace('_', ' '))}", _parameter(parameter)
    drops = sum(seen.drops.values())
    listed = ", ".join(f"{escape(name)}: {count}" for name, count in seen.drops.items())
    yield "Dropped", f"<span title='{listed}'>{drops}</span>"
    yield "Faults", in_colour(str(seen.faults), seen.faults > 0, False)
    free = seen.disk_free_bytes
    yield "Disk free", in_colour(words.size(free), free < _DISK_LOW_BYTES, free < _DISK_OUT_BYTES)


def _is_informative(parameter: Parameter) -> bool:
    """True for an informative parameter: most effects of the simulator are at zero in most models."""
    return parameter.value != 0 or parameter.low < parameter.high


def _parameter(parameter: Parameter) -> str:
    """Value, 90 % interval where it was estimated, unit where it has one."""
    interval = f"{words.number(parameter.low)} to {words.number(parameter.high)} "
    unit = escape(parameter.unit) if parameter.unit != "1" else ""
    estimated = parameter.low < parameter.high
    return f"{words.number(parameter.value)} <small>{interval if estimated else ''}{unit}</small>"


def log(state: ConsoleState, now_s: float) -> str:
    """The last notices and faults, the newest first."""
    if not state.log:
        return '<div class="dp"><small>No messages.</small></div>'
    lines = "".join(
        f"<p><time>{words.duration(max(now_s - entry.time_s, 0.0))}</time>"
        f"<span class='{'dp-bad' if isinstance(entry, Fault) else ''}'><b>{escape(entry.where)}</b> "
        f"{escape(entry.text)}</span></p>"
        for entry in reversed(state.log)
    )
    return f'<div class="dp dp-log">{lines}</div>'


def episode(state: ConsoleState) -> str:
    """Card of the episode: task, rig, seed and code version."""
    seen = state.episode
    if seen is None:
        return '<div class="dp"><small>No episode yet.</small></div>'
    rows = (
        ("Task", escape(seen.task)),
        ("Rig", escape(seen.rig)),
        ("Seed", str(seen.seed)),
        ("Code", escape(seen.code_version)),
        ("Motions", str(len(state.outcomes))),
    )
    return f'<div class="dp">{table(rows)}</div>'


def key() -> str:
    """Legend of the colours in the scene."""
    entries = (
        ("", palette.OBSERVED, "observed"),
        ("", palette.UNSEEN, "hidden, where it was"),
        ("", palette.GOAL, "goal"),
        ("", palette.PREDICTED, "after this motion"),
        ("", palette.HORIZON, "at the horizon"),
        ("", palette.EXPECTED, "last motion, as predicted"),
        ("", palette.LOOKED, "branch looked at"),
        ("", palette.COMPARED, "branch compared"),
        ("line", palette.BEST, "plan"),
        ("line", palette.CHEAP, "cheap branch"),
        ("line", palette.DEAR, "costly branch"),
    )
    spans = "".join(
        f"<span class='{shape}' style='--c:rgb{colour}'>{meaning}</span>" for shape, colour, meaning in entries
    )
    return f'<div class="dp"><div class="dp-key">{spans}</div></div>'


def table(rows: Iterable[tuple[str, str]]) -> str:
    """Table of names and values, both HTML."""
    return "<table>" + "".join(f"<tr><td>{name}</td><td>{value}</td></tr>" for name, value in rows) + "</table>"


def in_colour(text: str, warn: bool, bad: bool) -> str:
    """Text in the colour of its state."""
    tone = "dp-bad" if bad else "dp-warn" if warn else ""
    return f'<span class="{tone}">{escape(text)}</span>' if tone else escape(text)
