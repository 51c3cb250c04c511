"""A bar that counts what a command makes."""

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn


def counting(terminal: Console, *more: ProgressColumn) -> Progress:
    """What is made, how many of how many, and since when; gone when all are made."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, *more, console=terminal, transient=True)
