"""Help of the commands: readable on 80 columns, and each with an example that is a command line of that command."""

import functools
import re
import shlex
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import pytest
import tyro

from app.__main__ import COMMANDS, _module_of, command_names, main
from app.commands._paths import REGISTRY

COLUMNS = 80
EXAMPLE = re.compile(r"Example: (dipac .*)")


def commands(folder: Path = COMMANDS) -> list[tuple[str, ...]]:
    """Every command by the words that call it."""
    found = list[tuple[str, ...]]()
    for name, file in command_names(folder).items():
        found += [(name, *rest) for rest in commands(file)] if file.is_dir() else [(name,)]
    return found


def module(words: tuple[str, ...]) -> Any:
    """The module of a command, and the name of its function."""
    folder = COMMANDS
    for word in words[:-1]:
        folder = command_names(folder)[word]
    return _module_of(command_names(folder)[words[-1]])


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))


def lines(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Help of a command as it is printed."""
    with suppress(SystemExit):
        main([*words, "--help"])
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("words", [(), ("recordings",), ("calibration",), *commands()], ids=" ".join)
def test_help_fits_a_terminal_of_eighty_columns(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert [line for line in lines(words, capsys) if len(line) > COLUMNS] == []


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_help_has_an_example_that_the_command_takes(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    whole = module(words)
    function = getattr(whole, whole.__name__.rpartition(".")[2])
    example = EXAMPLE.search(whole.__doc__)
    assert example, "the last line of its file's docstring says: Example: dipac ..."
    called, *arguments = shlex.split(example[1])
    assert (called, *arguments[: len(words)]) == ("dipac", *words)
    given = getattr(whole, "ARGUMENTS", list[str])(arguments[len(words) :])
    inert = functools.wraps(function)(lambda *_, **__: "parsed")
    assert tyro.cli(inert, args=given, registry=REGISTRY) == "parsed"
    assert any(f"Example: dipac {' '.join(words)}" in line for line in lines(words, capsys))


def test_an_option_that_may_be_left_out_is_that_of_its_value_and_takes_none(capsys: pytest.CaptureFixture[str]) -> None:
    def say(*, file: Path | None = None, kind: Literal["rods", "mpm"] | None = None) -> tuple[Path | None, str | None]:
        return file, kind

    def parsed(*arguments: str) -> tuple[Path | None, str | None]:
        return tyro.cli(say, args=arguments, registry=REGISTRY)

    assert parsed() == (None, None)
    assert parsed("--file", "a.toml", "--kind", "mpm") == (Path("a.toml"), "mpm")
    assert parsed("--file", "None") == (None, None)
    with pytest.raises(SystemExit):
        parsed("--help")
    told = capsys.readouterr().out
    assert "--file PATH" in told
    assert "--kind {rods,mpm}" in told
