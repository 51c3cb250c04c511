"""Completion in shells: the scripts are what the shells read, and complete commands, options, choices and files."""

import shutil
import subprocess
from contextlib import redirect_stdout
from pathlib import Path

import pytest

from app.__main__ import main
from app.core.errors import UsageError

SHELLS = ("bash", "zsh", "fish")


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the script of each shell, under its name."""
    folder = tmp_path_factory.mktemp("completion")
    for shell in SHELLS:
        with (folder / shell).open("w", encoding="utf-8") as script, redirect_stdout(script):
            assert main(["--print-completion", shell]) == 0
    return folder


def completed(scripts: Path, folder: Path, *words: str) -> set[str]:
    """Offers of bash for the last of the words, in a folder."""
    names = " ".join(f"'{word}'" for word in words)
    program = (
        f"source {scripts}/bash; COMP_WORDS=({names}); COMP_CWORD={len(words) - 1}; COMP_TYPE=9; "
        "$(complete -p dipac | sed 's/.* -F \\([^ ]*\\) .*/\\1/'); printf '%s\\n' \"${COMPREPLY[@]}\""
    )
    found = subprocess.run(
        ["bash", "--norc", "-c", program], capture_output=True, text=True, check=True, cwd=folder, timeout=60
    )
    assert found.stderr == ""
    return {line for line in found.stdout.splitlines() if line}


@pytest.mark.serial
def test_bash_completes_commands_options_and_choices(scripts: Path, tmp_path: Path) -> None:
    assert completed(scripts, tmp_path, "dipac", "re") == {"recordings", "recover", "replay"}
    assert completed(scripts, tmp_path, "dipac", "recordings", "ex") == {"export"}
    assert "--labelled" in completed(scripts, tmp_path, "dipac", "recordings", "export", "--l")
    assert completed(scripts, tmp_path, "dipac", "run", "pour") == {"pour_soup", "pour_water"}
    assert completed(scripts, tmp_path, "dipac", "recordings", "export", "--to", "") == {"lerobot", "npz", "ply"}


@pytest.mark.serial
def test_bash_leaves_arguments_that_are_files_to_its_own_completion(scripts: Path, tmp_path: Path) -> None:
    assert completed(scripts, tmp_path, "dipac", "replay", "") == set()
    assert completed(scripts, tmp_path, "dipac", "run", "rope_push", "") == set()
    registered = subprocess.run(
        ["bash", "--norc", "-c", f"source {scripts}/bash; complete -p dipac"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "-o default" in registered.stdout


@pytest.mark.serial
@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_is_one_that_its_shell_reads(shell: str, scripts: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed.")
    subprocess.run([shell, "-n", str(scripts / shell)], check=True, timeout=60)


def test_a_shell_that_is_not_known_is_answered_with_those_that_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--print-completion", "tcsh"]) == UsageError.exit_code
    assert "Known: bash, fish, zsh" in capsys.readouterr().err
