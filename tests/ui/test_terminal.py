"""The terminal prints what messages say as it is, in lines of 80 characters whose columns stand below their titles.

Nobody waits for it: neither for one that takes nothing nor for a pipe whose reader has left.
"""

import errno
import io
import subprocess
import sys
import threading
from dataclasses import replace

import pytest
from anyio import to_thread
from rich.text import Text

from app.core.messages import Fault, Message, Notice, Outcome
from app.ui.terminal import LINES_BOUND, Output, Terminal, open_terminal, outcome_line
from tests.ui import synthetic


class Halted(io.StringIO):
    """A terminal after Ctrl-S: it takes nothing until it goes on."""

    def __init__(self) -> None:
        super().__init__()
        self.goes_on = threading.Event()

    def write(self, text: str) -> int:
        assert self.goes_on.wait(60)
        return super().write(text)


class Awaited(io.StringIO):
    """A terminal that knows when `text` has been written to it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.seen = threading.Event()
        self._text = text

    def write(self, text: str) -> int:
        if self._text in text:
            self.seen.set()
        return super().write(text)


class Gone(io.StringIO):
    """A terminal that was hung up."""

    def write(self, text: str) -> int:
        raise OSError(errno.EIO, "Input/output error")


def printed(*messages: Message) -> list[str]:
    output = io.StringIO()
    terminal = Terminal(Output(file=output, width=80))
    terminal.start()
    for message in messages:
        terminal.show(message)
    terminal.close()
    return output.getvalue().splitlines()


def notice(text: str) -> Notice:
    return Notice(id="notice-1", time_s=0.0, where="arm", text=text)


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


def test_in_a_file_each_compilation_is_said_once():
    said = ["planning", "compiling plan (1 s)", "compiling plan (2 s)", "planning", "compiling roll-out (1 s)"]
    _, *lines = printed(*(replace(synthetic.health(), doing=doing) for doing in said))
    assert lines == ["compiling plan ...", "compiling roll-out ..."]


def test_on_a_terminal_the_stage_is_shown_until_the_end():
    screen = Awaited("compiling plan (2 s)")
    terminal = Terminal(Output(file=screen, width=80, force_terminal=True))
    terminal.start()
    terminal.show(replace(synthetic.health(), doing="compiling plan (2 s)"))
    assert screen.seen.wait(10)
    terminal.close()
    shows_cursor = "\x1b[?25h"
    assert shows_cursor in screen.getvalue()


def test_a_long_address_stays_in_one_line():
    output, address = io.StringIO(), "http://127.0.0.1:8088/?token=" + 80 * "x"
    terminal = Terminal(Output(file=output, width=80), Text(address, no_wrap=True))
    terminal.start()
    terminal.close()
    assert output.getvalue().splitlines()[0] == address


@pytest.mark.anyio
async def test_nobody_waits_for_a_halted_terminal_and_what_it_missed_is_counted():
    screen, texts = Halted(), [f"notice {index}" for index in range(LINES_BOUND + 50)]
    async with open_terminal(Output(file=screen, width=80)) as terminal:
        for text in texts:
            terminal.show(notice(text))
    assert screen.getvalue() == ""
    screen.goes_on.set()
    await to_thread.run_sync(terminal.close)
    _, *lines, last = screen.getvalue().splitlines()
    assert lines == [f"arm: {text}" for text in texts[: len(lines)]]
    assert len(lines) + terminal.left_out == len(texts)
    assert last == f"{terminal.left_out} lines were left out: the terminal took none."


_READER_LEAVES = """
import sys
import anyio
from app.core.messages import Notice
from app.ui.terminal import Output, open_terminal

async def main():
    output = Output()
    async with open_terminal(output) as terminal:
        sys.stdin.readline()
        for _ in range(3):
            terminal.show(Notice(id="notice-1", time_s=0.0, where="arm", text="moves"))
    output.print("summary")
    print("went on", file=sys.stderr)

anyio.run(main)
"""


@pytest.mark.serial
def test_a_pipe_whose_reader_has_left_ends_the_printing_and_nothing_else():
    with subprocess.Popen(
        [sys.executable, "-c", _READER_LEAVES],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as program:
        assert program.stdin
        assert program.stdout
        assert program.stderr
        assert program.stdout.readline().startswith("push")
        program.stdout.close()
        program.stdin.write("\n")
        program.stdin.close()
        assert program.stderr.read() == "went on\n"
    assert program.returncode == 0


def test_a_terminal_that_is_gone_ends_the_printing_and_nothing_else():
    output = Output(file=Gone())
    terminal = Terminal(output)
    terminal.start()
    terminal.show(notice("moves"))
    terminal.close()
    output.print("summary")
    assert output.quiet
