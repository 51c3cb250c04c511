"""Measure what docs/results.md states; each bench prints a table."""

import ast
import importlib
from pathlib import Path

import tyro
from rich.console import Console

from app.core.errors import PreflightError, UsageError

FOLDER = Path(__file__).parents[2] / "bench"


def bench(
    names: tyro.conf.Positional[tuple[str, ...]] = (), /, *, list_only: bool = False, json: Path | None = None
) -> None:
    """Run the named benches one after the other, or all of them; `--list-only` says what there is.

    Benches live beside the package, in a checkout of the project, and each takes minutes. `--json FILE` also writes the
    rows of a single bench that makes them: sim.
    """
    output = Console()
    known = _known()
    for name in names:
        if name not in known:
            raise UsageError.unknown("bench", name, known)
    if json is not None and (len(names) != 1 or not _writes_rows(names[0])):
        raise UsageError(
            f"--json takes one bench that makes rows; those are: {', '.join(filter(_writes_rows, known))}."
        )
    for name in names or known:
        output.print(f"[bold]{name}[/]: {known[name]}", highlight=False)
        if not list_only:
            rows = {} if json is None else {"json": json}
            importlib.import_module(f"bench.{name}").main(**rows)


def _writes_rows(name: str) -> bool:
    """Whether a bench's `main` takes a file to write its rows to."""
    tree = ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))
    mains = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"]
    return any(argument.arg == "json" for main in mains for argument in main.args.args + main.args.kwonlyargs)


def _known() -> dict[str, str]:
    """The benches, modules of the folder with a function `main`, and the first lines of their docstrings."""
    if not FOLDER.is_dir():
        raise PreflightError("Benches are not part of the installed package; run `dipac bench` from a checkout.")
    known: dict[str, str] = {}
    for file in sorted(FOLDER.glob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            known[file.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    return known
