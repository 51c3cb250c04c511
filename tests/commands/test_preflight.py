"""Files and ports that cannot be used are refused before the work; checking them leaves nothing behind."""

import socket
from pathlib import Path

import pytest

from app.commands._preflight import check_port, check_writable
from app.commands.run import run
from app.config import Site
from app.core.errors import PreflightError, UsageError


def test_a_file_that_can_be_written_is_left_as_it_was(tmp_path: Path):
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_text("kept")
    check_writable(old, "-o")
    check_writable(new, "-o")
    assert old.read_text() == "kept"
    assert not new.exists()


@pytest.mark.parametrize("name", ["", "none/file", "file/below"])
def test_a_file_that_cannot_be_written_is_refused_and_its_option_named(name: str, tmp_path: Path):
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match=r"^Cannot write .*; choose another place with --json\.$"):
        check_writable(tmp_path / name, "--json")


def test_a_run_whose_outcome_could_not_be_written_is_not_started(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(UsageError, match="--json"):
        run(json=tmp_path / "none" / "outcome.json")
    assert capsys.readouterr().out == ""


@pytest.mark.serial
def test_a_port_is_refused_only_while_it_is_taken():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        site = Site(console_port=taken.getsockname()[1])
        with pytest.raises(PreflightError, match="--port"):
            check_port(site)
    check_port(site)
    check_port(site)
