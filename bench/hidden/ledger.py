"""Result files of lines: finished cases are not repeated, and files of several machines are read as one."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from app.evaluation.results_log import lines
from bench.hidden.draws import SIZES


def key_of(line: dict[str, Any]) -> str:
    """Unique key of a line: the world, conditions of recording and solver, the seed, the number, the study's size."""
    case = whole_case(line)
    names = ("world", "task", "dynamics", "images", "seed", "number", "episodes", "pushes", "sizes", "family")
    return "-".join(str(case[name]) for name in names)


def whole_case(line: dict[str, Any]) -> dict[str, Any]:
    """Case of a line; those that do not say are of ropes as material points, of images if MuJoCo's, of usual sizes."""
    usual = {"task": "rope_push", "dynamics": "mpm", "sizes": list(SIZES), "family": None}
    return {**usual, "images": line["case"]["world"] == "mujoco", **line["case"]}


def read(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """The lines of all files that exist, each case once: the last line of it that has a verdict, else the last.

    A line that was cut off in the middle counts for nothing.
    """
    found = dict[str, dict[str, Any]]()
    for path in paths:
        for line in lines(path):
            if "case" in line and ("verdict" in line or "verdict" not in found.get(key_of(line), {})):
                found[key_of(line)] = line
    return list(found.values())


def finished(known: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Lines with a verdict."""
    return [line for line in known if "verdict" in line and "truth" in line]
