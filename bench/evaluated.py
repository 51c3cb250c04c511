"""The tables of docs/results.md from the rows that were measured: `python -m bench.evaluated [FILE]`. See `--help`."""

from pathlib import Path
from typing import Annotated

import tyro

from app.evaluation import results_log
from app.evaluation.scores import scores
from app.evaluation.tables import markdown

MEASURED = Path(__file__).parents[1] / "docs" / "measured" / "evaluation.jsonl"


def main(file: Annotated[Path, tyro.conf.Positional] = MEASURED) -> None:
    """Print the tables of an evaluation's rows, as Markdown."""
    print(markdown(scores(results_log.latest(file))))


if __name__ == "__main__":
    tyro.cli(main)
