"""The command line `dipac`: finds a command, imports that one alone, and reports every error in one line.

A command is a file in `app/commands` that defines a function of its own name; the function's typed parameters become
the command's options, and both docstrings its help: the file's begins with its line in the overview and ends with an
example. So a new command is one new file. A folder there is a command with commands of its own, found in the same way;
the docstring of its package is its help.
"""

import ast
import atexit
import errno
import importlib
import inspect
import io
import os
import re
import shutil
import sys
import tempfile
import textwrap
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from app import __version__
from app.core.errors import DipacError, PreflightError, UsageError
from app.core.system.signals import EndingSignal, system_interrupts
from app.core.system.standard_streams import OutputRefused, prepare_streams, silence

if TYPE_CHECKING:
    from app.commands._completion import Command

COMMANDS = Path(__file__).parent / "commands"
_COMPLETE = "--print-completion"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line (that of the process by default); returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    prepare_streams()
    with system_interrupts() as ending:
        return exit_code_of(lambda: _run(given), ending)


def exit_code_of(action: Callable[[], None], ending: EndingSignal | None = None) -> int:
    """Exit code of `action`: 0 on return; a deliberate error's own, printed on stderr in one line; 130 for Ctrl-C.

    Another signal that ends the program is the `ending`. Text that standard output does not take ends the program
    as well, silently where its reader has left (`| head`).

    A library that is not installed is a fault of the installation, and reported in one line as well.

    Tasks that run side by side raise their errors in groups: such a group counts as its first error where all of it was
    deliberate. Anything else is a defect of the program and keeps its traceback.
    """
    try:
        try:
            action()
        finally:
            sys.stdout.flush()
    except (DipacError, KeyboardInterrupt, BaseExceptionGroup) as error:
        leaves = list(_leaves(error))
        if any(isinstance(leaf, KeyboardInterrupt) for leaf in leaves):
            ended_by = ending or EndingSignal()
            _complain(ended_by.text)
            return ended_by.exit_code
        deliberate = [leaf for leaf in leaves if isinstance(leaf, DipacError)]
        if len(deliberate) < len(leaves):
            raise
        for leaf in deliberate:
            _complain(str(leaf))
        return deliberate[0].exit_code
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == __package__:
            raise
        _complain(
            f"the Python package {error.name} is missing: `make clean setup` makes .venv anew in a checkout; "
            "elsewhere install dipac anew. Recordings stay"
        )
        return DipacError.exit_code
    except OutputRefused as error:
        silence(sys.stdout)
        if error.errno == errno.EPIPE:
            return DipacError.exit_code
        _complain(f"cannot print ({error.strerror}); make room, or print to another place")
        return PreflightError.exit_code
    return 0


def _keep_compiled() -> None:
    """Have every process started from here cache compiled JAX and Warp code, so that the next start is a warm one.

    A setting in the environment takes precedence. A home that cannot be written to is reported in one line, and
    compiled code then lies in a temporary folder that is removed with this process.
    """
    try:
        compiled = _compiled_folder()
        compiled.mkdir(parents=True, exist_ok=True)
        # As a library would use it: a folder that is there may still be read-only.
        tempfile.TemporaryFile(dir=compiled).close()
    except (OSError, RuntimeError) as error:
        _complain(
            f"compiled programs cannot be kept ({error}), so every start compiles them anew: "
            "set XDG_CACHE_HOME to a folder that can be written to"
        )
        temporary = tempfile.mkdtemp(prefix="dipac-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        # Warp and Matplotlib look there as well.
        os.environ.update(XDG_CACHE_HOME=temporary, XDG_CONFIG_HOME=temporary)
        compiled = _compiled_folder()
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(compiled))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.2")


def _compiled_folder() -> Path:
    """Our part of the user's cache folder (XDG Base Directory Specification). RuntimeError without a home."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "dipac", "compiled")


def command_names(folder: Path = COMMANDS) -> dict[str, Path]:
    """Every command by its name on the command line, with its file, or its folder where it has commands of its own."""
    found = (path for path in sorted(folder.iterdir()) if path.suffix == ".py" or (path / "__init__.py").is_file())
    public = (path for path in found if not path.stem.startswith("_"))
    # A command that is a word of Python's, like `import`, has a file and a function that end in an underscore.
    return {path.stem.rstrip("_").replace("_", "-"): path for path in public}


def _run(arguments: list[str]) -> None:
    if arguments[:1] == ["--version"]:
        sys.stdout.write(f"dipac {__version__}\n")
    elif arguments[:1] == [_COMPLETE]:
        _print_completion(*arguments[1:2])
    else:
        _run_among(COMMANDS, "dipac", arguments)


def _run_among(folder: Path, prog: str, arguments: list[str]) -> None:
    name, *rest = arguments or ["--help"]
    files = command_names(folder)
    if name in ("-h", "--help", "help"):
        sys.stdout.write(_overview(files, prog))
    elif name not in files:
        raise UsageError.unknown("command", name, files)
    elif files[name].is_dir():
        _run_among(files[name], f"{prog} {name}", rest)
    else:
        _run_command(files[name], f"{prog} {name}", rest)


def _run_command(file: Path, prog: str, arguments: list[str]) -> None:
    _keep_compiled()
    import tyro  # Costs more than everything else here together, and `--help` does without it.

    from app.commands._paths import REGISTRY

    module = _module_of(file)
    function, read = getattr(module, file.stem), getattr(module, "ARGUMENTS", list[str])
    text, given = _description(module, function), read(arguments)
    with _wrapped_output() if {"-h", "--help"} & set(given) else nullcontext():
        tyro.cli(function, prog=prog, description=text, args=given, registry=REGISTRY)


@contextmanager
def _wrapped_output() -> Generator[None]:
    """Print what is printed meanwhile in lines of the terminal's width: tyro wraps options alone."""
    terminal, width = sys.stdout, shutil.get_terminal_size().columns
    with redirect_stdout(io.StringIO()) as printed:
        try:
            yield
        finally:
            lines = [
                textwrap.fill(line, width, subsequent_indent=_INDENT if line.startswith("usage:") else "")
                for line in _GAP.sub("\n\n", printed.getvalue()).rstrip().splitlines()
            ]
            terminal.write("\n".join([*lines, ""]))


def _module_of(file: Path) -> ModuleType:
    return importlib.import_module(".".join(("app", *file.relative_to(COMMANDS.parent).with_suffix("").parts)))


def _description(module: ModuleType, function: Callable[..., object]) -> str:
    """Text of a command's `--help`: its module's docstring and, before the example there, its function's."""
    *told, example = (inspect.getdoc(module) or "").split("\n\n")
    details = _SECTION.split(inspect.getdoc(function) or "")[0].split("\n\n")
    return "\n\n".join(each for each in (*told, *details, example) if each)


_GAP = re.compile(r"\n{3,}")
_INDENT = " " * len("usage: ")
_SECTION = re.compile(r"^(?:Args|Returns|Raises):$", re.MULTILINE)


def _print_completion(shell: str = "") -> None:
    """Print the script that completes words in a shell; every command is imported for it."""
    from app.commands._completion import completion_script

    sys.stdout.write(completion_script(shell, _command_tree(COMMANDS)))


def _command_tree(folder: Path) -> "dict[str, Command]":
    """All commands of a folder, with the functions that they are."""
    from app.commands._completion import Command

    return {
        name: Command(_first_line(file), _command_tree(file) if file.is_dir() else getattr(_module_of(file), file.stem))
        for name, file in command_names(folder).items()
    }


def _overview(files: dict[str, Path], prog: str) -> str:
    width = max(map(len, files), default=0)
    lines = [f"  {name:<{width}}  {_first_line(file)}" for name, file in files.items()]
    head, tail = (_FIRST_STEPS, _MORE) if prog == "dipac" else ((), ())
    return "\n".join(
        [
            f"usage: {prog} COMMAND [options]",
            "",
            *head,
            *lines,
            "",
            f"`{prog} COMMAND --help` says more, lists options and has an example.",
            *tail,
            "",
        ]
    )


_FIRST_STEPS = (
    "A robot arm moves ropes, beans, cloths and liquids by plans that it simulates.",
    "",
    "First steps:",
    "  dipac run rope_push       a simulated arm pushes a rope to a goal, by itself",
    "  dipac console rope_push   the same in the browser; you approve each motion",
    "  dipac recordings list     what was recorded; `dipac replay FILE` shows it",
    "",
    "Commands:",
)
_MORE = (
    "`dipac --version` prints the version; `dipac --print-completion bash`, zsh or",
    "fish, a script that completes words in that shell (docs/installing.md).",
)


def _first_line(path: Path) -> str:
    """The first line of a module's docstring, read without importing the module."""
    file = path / "__init__.py" if path.is_dir() else path
    docstring = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return docstring.partition("\n")[0]


def _leaves(error: BaseException) -> Iterator[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        for inner in error.exceptions:
            yield from _leaves(inner)
    else:
        yield error


def _complain(text: str) -> None:
    from rich.console import Console  # Only a program that fails pays for it.

    line = " ".join(f"dipac: {text}".splitlines())
    with suppress(OSError):  # The exit code says it, too, where nobody reads stderr.
        Console(stderr=True, soft_wrap=True).print(line, style="red", markup=False, highlight=False)


if __name__ == "__main__":
    sys.exit(main())
