"""Measure what docs/results.md states; each bench prints a table.

Example: dipac bench sim
"""

import ast
import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.core.errors import PreflightError, UsageError

FOLDER = Path(__file__).parents[2] / "bench"
_OWN = ("-h", "--help", "--list-only", "--no-list-only", "--json")


def bench(
    names: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="NAME ...", help="benches; all where none is named", help_behavior_hint=""),
    ] = (),
    /,
    *,
    list_only: Annotated[bool, tyro.conf.arg(help="say what there is, and measure nothing")] = False,
    json: Annotated[Path | None, tyro.conf.arg(help="write the rows of a single bench to this file")] = None,
) -> None:
    """Run the named benches one after the other, or all of them; `--list-only` lists them.

    Benches live beside the package, in a checkout of the project, and each takes minutes. `--json FILE` also writes the
    rows of a single bench that makes them: sim. Options of a single bench that has some come last: discovery --n 20.
    """
    output = Console()
    known = _available_benches()
    names, options = _names_and_options(names)
    if options and (len(names) != 1 or names[0] not in known or not _takes(names[0], "options")):
        takers = ", ".join(name for name in known if _takes(name, "options"))
        raise UsageError(f"{options[0]} is no option of `dipac bench`; a single bench has options: {takers}.")
    for name in names:
        if name not in known:
            raise UsageError.unknown("bench", name, known)
    if json is not None and (len(names) != 1 or not _takes(names[0], "json")):
        makers = ", ".join(name for name in known if _takes(name, "json"))
        raise UsageError(f"--json takes one bench that makes rows; those are: {makers}.")
    for name in names or known:
        output.print(f"[bold]{name}[/]: {known[name]}", highlight=False)
        if not list_only:
            given = {"json": json, "options": options}
            importlib.import_module(f"bench.{name}").main(**{key: value for key, value in given.items() if value})


def _insert_separator(given: Sequence[str]) -> list[str]:
    """The command line, on which `--` stands before the first option that is a bench's own."""
    at = next((at for at, word in enumerate(given) if word[:1] == "-" and word.split("=")[0] not in _OWN), None)
    return list(given) if at is None else [*given[:at], "--", *given[at:]]


ARGUMENTS = _insert_separator
"""Preprocessing of the command line, before its options are parsed."""


def _names_and_options(words: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of benches, and the options of the bench, from the first option on."""
    at = next((at for at, word in enumerate(words) if word[:1] == "-"), len(words))
    return tuple(words[:at]), tuple(words[at:])


def _takes(name: str, parameter: str) -> bool:
    """True if a bench's `main` has this parameter."""
    tree = ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))
    mains = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"]
    return any(argument.arg == parameter for main in mains for argument in main.args.args + main.args.kwonlyargs)


def _available_benches() -> dict[str, str]:
    """The benches, modules of the folder with a function `main`, and the first lines of their docstrings."""
    if not FOLDER.is_dir():
        raise PreflightError("Benches are not part of the installed package; run `dipac bench` from a checkout.")
    known: dict[str, str] = {}
    for file in sorted(FOLDER.glob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            known[file.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    return known
