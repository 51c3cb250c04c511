"""The program's commands, run as a reader would run them, and what pages show of them."""

import os
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from app.core.errors import UsageError

ROOT: Final = Path(__file__).parents[1]
_SAID: Final = 500
"""Last characters of an error that are told."""


def joined(command: Sequence[str]) -> str:
    """The command as a reader types it."""
    return " ".join(word if "*" in word else shlex.quote(word) for word in command)


def run(command: Sequence[str], folder: Path, *, module: str = "app", shown: bool = False) -> str:
    """Output of the program, or of another module, in a folder; `shown`: also here as it comes, and all of its errors.

    Raises UsageError if it fails.
    """
    words = [word for each in command for word in _spread(each, folder)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "80", "NO_COLOR": "1", "PYTHONUNBUFFERED": "1"}
    order = [sys.executable, "-m", module, *words]
    errors = None if shown else subprocess.PIPE
    with subprocess.Popen(
        order, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=errors
    ) as process:
        if shown:
            output, error = _echo(process), "see above"
        else:
            output, error = process.communicate()
    if process.returncode != 0:
        raise UsageError(f"{module} {joined(command)} failed in {folder}: {error.strip()[-_SAID:]}")
    return output


def _echo(process: subprocess.Popen[str]) -> str:
    """Print its lines as they come; all of them."""
    lines = list[str]()
    for line in process.stdout or ():
        lines.append(line)
        print(line, end="", flush=True)
    return "".join(lines)


def _spread(word: str, folder: Path) -> list[str]:
    """Expansion of a word with a star, as by a shell."""
    return sorted(str(path.relative_to(folder)) for path in folder.glob(word)) if "*" in word else [word]


def hidden_in(truth: Mapping[str, Any]) -> str:
    """Effects of a sealed file, as text."""
    effects = [f"`{effect['effect']}` ({_values(effect['parameters'])})" for effect in truth["effects"]]
    return " and ".join(effects) or "nothing"


def _values(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {each['value']:.3g} {each['unit']}" for name, each in parameters.items())
