"""Scripts that complete the program's commands, options, choices and files in a shell."""

import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

from tyro.extras import SubcommandApp

from app.commands._paths import REGISTRY
from app.core.errors import UsageError

_WRITE: Final = "--tyro-write-completion"

# The scripts of tyro know options, choices and files of options, but no files that are plain arguments: a word that is
# no option and no command is a file.
_FILES: Final[Mapping[str, str]] = {
    "bash": """
_dipac() {
  _tyro_dipac
  [[ ${COMP_WORDS[COMP_CWORD]} == -* ]] && return
  local word
  for word in "${COMPREPLY[@]}"; do
    [[ -n $word && $word != -* ]] && return
  done
  COMPREPLY=()
}
complete -o default -F _dipac dipac
""",
    "zsh": """
if (( CURRENT > 2 )) && [[ $PREFIX != -* ]]; then
  _files
fi
""",
    "fish": """
complete --command dipac --force-files --condition 'not _tyro_dipac | string match --quiet --regex "^[^-]"'
""",
}
SHELLS: Final = tuple(_FILES)


class Command(NamedTuple):
    """A command: its line in the overview, and its function or its own commands."""

    line: str
    target: "Callable[..., Any] | CommandTree"


CommandTree: TypeAlias = Mapping[str, Command]


def completion_script(shell: str, commands: CommandTree) -> str:
    """Script for bash, zsh or fish. Raises UsageError for any other shell."""
    if shell not in _FILES:
        raise UsageError.unknown("shell", shell, SHELLS)
    with tempfile.TemporaryDirectory(prefix="dipac-") as folder:
        file = Path(folder, shell)
        with suppress(SystemExit):  # tyro ends the program when it has written the script.
            _command_line(commands).cli(prog="dipac", args=[_WRITE, shell, str(file)], registry=REGISTRY)
        return file.read_text(encoding="utf-8") + _FILES[shell]


def _command_line(commands: CommandTree) -> SubcommandApp:
    """All commands as one command line."""
    whole = SubcommandApp()
    for name, (line, target) in commands.items():
        if callable(target):
            whole.command(name=name, help=line)(target)
        else:
            whole.command(_command_line(target), name=name, help=line)
    return whole
