"""Scripts that complete the program's commands, options, choices and files in a shell."""

import re
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias, get_type_hints

from tyro.extras import SubcommandApp

from app.commands._arguments import TaskArgument
from app.commands._paths import REGISTRY
from app.core.errors import UsageError
from app.tasks import names

_WRITE: Final = "--tyro-write-completion"

# The scripts of tyro know options, choices and files of options, but no plain arguments: here the first of TAKERS is
# one of TASKS, and any other word that is no option and no command is a file.
_ARGUMENTS: Final[Mapping[str, str]] = {
    "bash": """
_dipac() {
  _tyro_dipac
  local word now=${COMP_WORDS[COMP_CWORD]}
  [[ $now == -* ]] && return
  if [[ $COMP_CWORD == 2 && " TAKERS " == *" ${COMP_WORDS[1]} "* ]]; then
    COMPREPLY=($(compgen -W "TASKS" -- "$now"))
    return
  fi
  for word in "${COMPREPLY[@]}"; do
    [[ -n $word && $word != -* ]] && return
  done
  COMPREPLY=()
}
complete -o default -F _dipac dipac
""",
    "zsh": """
if [[ $PREFIX != -* ]]; then
  if (( CURRENT == 3 )) && [[ " TAKERS " == *" ${words[2]} "* ]]; then
    compadd -- TASKS
  elif (( CURRENT > 2 )); then
    _files
  fi
fi
""",
    "fish": """
set -l plain 'not _tyro_dipac | string match --quiet --regex "^[^-]"'
set -l task 'test (count (commandline -opc)) -eq 2; and __fish_seen_subcommand_from TAKERS'
complete --command dipac --no-files --condition "$task" --arguments "TASKS"
complete --command dipac --force-files --condition "not begin; $task; end; and $plain"
""",
}
SHELLS: Final = tuple(_ARGUMENTS)


class Command(NamedTuple):
    """A command: its line in the overview, and its function or its own commands."""

    line: str
    target: "Callable[..., Any] | CommandTree"


CommandTree: TypeAlias = Mapping[str, Command]


def completion_script(shell: str, commands: CommandTree) -> str:
    """Script for bash, zsh or fish. Raises UsageError for any other shell."""
    if shell not in _ARGUMENTS:
        raise UsageError.unknown("shell", shell, SHELLS)
    with tempfile.TemporaryDirectory(prefix="dipac-") as folder:
        file = Path(folder, shell)
        with suppress(SystemExit):  # tyro ends the program when it has written the script.
            _command_line(commands).cli(prog="dipac", args=[_WRITE, shell, str(file)], registry=REGISTRY)
        arguments = _ARGUMENTS[shell].replace("TAKERS", " ".join(_takers(commands))).replace("TASKS", " ".join(names()))
        return _SPEC.sub(_in_one_line, file.read_text(encoding="utf-8")) + arguments


_SPEC: Final = re.compile(r"^COMPLETION_SPEC = .*$", re.MULTILINE)


def _in_one_line(spec: re.Match[str]) -> str:
    """The specification with descriptions of a line each: a shell takes the second line of one for a completion."""
    return re.sub(r"\\+n", " ", spec[0])


def _takers(commands: CommandTree) -> list[str]:
    """Commands whose first argument is a task."""
    functions = {name: it.target for name, it in commands.items() if callable(it.target)}
    return [name for name, it in functions.items() if TaskArgument in get_type_hints(it, include_extras=True).values()]


def _command_line(commands: CommandTree) -> SubcommandApp:
    """All commands as one command line."""
    whole = SubcommandApp()
    for name, (line, target) in commands.items():
        if callable(target):
            whole.command(name=name, help=line)(target)
        else:
            whole.command(_command_line(target), name=name, help=line)
    return whole
