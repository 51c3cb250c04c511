"""Progress bars that count what a command makes, and tables that are not cut off."""

from rich.console import Console
from rich.measure import Measurement
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

_WIDEST = 1000


def counting(terminal: Console, *more: ProgressColumn) -> Progress:
    """Progress bar with count, total and elapsed time; it disappears at the end."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, *more, console=terminal, transient=True, disable=not terminal.is_terminal)


def print_whole(terminal: Console, table: Table) -> None:
    """The table with every cell on one line, however narrow the terminal: a path that is cut off is of no use."""
    needed = Measurement.get(terminal, terminal.options.update(max_width=_WIDEST), table).maximum
    wide = Console(file=terminal.file, width=max(needed, terminal.width), highlight=False)
    wide.print(table, no_wrap=True)
