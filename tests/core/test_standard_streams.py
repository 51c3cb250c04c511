"""Printing to what takes no text, or not every character, is no traceback."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT

pytestmark = pytest.mark.serial

PRINTING = """
import sys
import app.__main__ as program
from app.core.errors import UsageError
program._run = lambda given: {body}
sys.exit(program.main([]))
"""


def run(body: str, redirection: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    script = f'"$0" -c "$1" {redirection}'
    return subprocess.run(
        ["bash", "-c", script, sys.executable, PRINTING.format(body=body)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        check=False,
        timeout=60,
    )


PLAIN = "sys.stdout.write('much ' * 100_000)"
RICH = "[__import__('rich').print('much ' * 100) for _ in range(100)]"


@pytest.mark.parametrize("body", [PLAIN, RICH, "print('short')"], ids=["plain", "rich", "short"])
def test_a_full_disk_is_said_in_one_line(body):
    found = run(body, "> /dev/full")
    assert found.stderr == b"dipac: cannot print (No space left on device); make room, or print to another place\n"
    assert found.returncode == 3


@pytest.mark.parametrize("body", [PLAIN, RICH], ids=["plain", "rich"])
def test_a_reader_that_has_left_is_no_word_worth(body):
    found = run(body, "| true; exit ${PIPESTATUS[0]}")
    assert (found.stdout, found.stderr, found.returncode) == (b"", b"", 1)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_characters_that_an_encoding_lacks_are_replaced(encoding):
    found = run("print('a \\u2013 b \\udcff')", "", PYTHONIOENCODING=encoding)
    dash = "\u2013" if encoding == "utf-8" else "?"
    assert (found.stdout.decode(encoding), found.stderr) == (f"a {dash} b ?\n", b"")


def test_a_closed_output_is_none_and_takes_no_number_of_a_file():
    body = "(sys.stdout.write('x'), sys.exit(open('/dev/null').fileno()))"
    found = run(body, ">&- 2>&- <&-")
    assert (found.stdout, found.stderr) == (b"", b"")
    assert found.returncode > 2


def test_an_error_is_said_by_the_exit_code_where_standard_error_is_full():
    found = run("(_ for _ in ()).throw(UsageError('wrong'))", "2> /dev/full")
    assert (found.stdout, found.returncode) == (b"", 2)
