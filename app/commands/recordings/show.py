"""Show a recording's origin, channels, pushes, notices and faults.

Example: dipac recordings show recordings/FILE.mcap
"""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands._arguments import FileArgument
from app.commands._progress import print_whole
from app.core.dialogue.words import duration, number, size
from app.core.errors import RecordingError
from app.core.messages import Executed, Fault, Message, Model, Notice, Outcome, Parameter
from app.recording.format import digests
from app.recording.format.integrity import require_file
from app.recording.library.label import labels
from app.recording.library.recording_index import Entry, entry
from app.recording.read.reader import read_messages
from app.ui.terminal import HEADER, outcome_line


def show(file: FileArgument, /) -> None:
    """Print everything but images and clouds, which Foxglove shows.

    Args:
        file: the recording.
    """
    require_file(file)
    found = entry(file)
    if found.condition != "whole":
        raise RecordingError(found.state)
    terminal = Console(highlight=False, soft_wrap=True)
    said = list(read_messages(file, [Outcome, Executed, Model, Notice, Fault]))
    _print_facts(terminal, found)
    print_whole(terminal, _channels(found))
    _print_pushes(terminal, said)
    _print_log(terminal, said, began_s=float(found.metadata["time_s"]))


def _print_facts(terminal: Console, found: Entry) -> None:
    metadata = found.metadata
    rows = {
        "recording": str(found.path),
        "began": f"{found.began:%Y-%m-%d %H:%M:%S} UTC" if found.began else "",
        "length, size": f"{duration(found.duration_s)}, {size(found.size_bytes)}",
        **{name: metadata.get(name, "") for name in ("task", "rig", "seed", "code_version", "schema_version")},
        "config": metadata.get("config", ""),
        "SHA-256": digests.stored_digest(found.path) or f"not in {digests.SUMS}",
    }
    for label in labels(found.path):
        rows[f"labelled {label.at} "] = " ".join(filter(None, [label.said, f"({label.operator})", label.note]))
    for name, value in rows.items():
        terminal.print(Text.assemble((f"{name.replace('_', ' '):<16}", "bold"), value))


def _channels(found: Entry) -> Table:
    table = Table("channel", "messages", "a second", box=None)
    for topic, count in sorted(found.counts.items()):
        table.add_row(topic, str(count), number(count / found.duration_s) if found.duration_s > 0 else "")
    return table


def _print_pushes(terminal: Console, said: Sequence[Message]) -> None:
    outcomes = [message for message in said if isinstance(message, Outcome)]
    if outcomes:
        terminal.print(Text(HEADER, "bold"))
    for outcome in outcomes:
        terminal.print(Text(outcome_line(outcome)))
    for executed in (message for message in said if isinstance(message, Executed)):
        if executed.outcome != "completed":
            terminal.print(Text(f"A motion ended {executed.outcome}: {executed.reason}", "yellow"))
    for model in (message for message in said if isinstance(message, Model)):
        fitted = [it for it in (*model.parameters, *model.apparatus) if it.low < it.high]
        told = ", ".join(map(_parameter, fitted)) or "nothing was estimated"
        terminal.print(Text(f"Model v{model.version}: {told}"))


def _parameter(it: Parameter) -> str:
    return f"{it.name} {number(it.value)} ({number(it.low)} to {number(it.high)}) {it.unit}"


def _print_log(terminal: Console, said: Sequence[Message], *, began_s: float) -> None:
    for message in said:
        if isinstance(message, Notice | Fault):
            tone = "red" if isinstance(message, Fault) else "cyan"
            at = f"{message.time_s - began_s:8.1f} s  "
            terminal.print(Text.assemble(at, (message.where, tone), f": {message.text}"))
