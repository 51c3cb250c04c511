"""The full name of a task: the problem, sizes of its object and tool that differ from the default, and its dynamics."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self, final

from app.core.errors import UsageError

_WRITTEN = re.compile(r"(?P<problem>[^@()]+)(?:\((?P<sizes>[^()]*)\))?(?:@(?P<dynamics>[^@()]+))?")


@final
@dataclass(frozen=True)
class TaskName:
    """PROBLEM(size=value,...)@DYNAMICS, where sizes and dynamics may be left out.

    A recording is of a problem and its sizes, whatever its pushes were planned with; a model is of dynamics besides.
    `sizes`: [m], [kg] or [rad], by name; `dynamics`: "mpm", material points, or "rods".
    """

    problem: str
    sizes: tuple[tuple[str, float], ...] = ()
    dynamics: str = "mpm"

    @classmethod
    def of(cls, problem: str, sizes: Mapping[str, float], dynamics: str = "mpm") -> Self:
        """The name with its sizes in order, so that equal tasks have equal names."""
        return cls(problem, tuple(sorted((name, float(value)) for name, value in sizes.items())), dynamics)

    @classmethod
    def parse(cls, text: str) -> Self:
        """The inverse of `str`. Raises UsageError where the text is no such name."""
        found = _WRITTEN.fullmatch(text)
        try:
            if found is None:
                raise ValueError("it is not of that form")
            pairs = [pair.split("=") for pair in (found["sizes"] or "").split(",") if pair]
            if len({name for name, *_ in pairs}) < len(pairs):
                raise ValueError("a size stands there twice")
            return cls.of(found["problem"], {name: float(value) for name, value in pairs}, found["dynamics"] or "mpm")
        except ValueError as error:
            form = "rope_push, or rope_push(length_m=0.3,radius_m=0.006)@rods"
            raise UsageError(f"{text!r} is no name of a task ({error}); give one such as {form}.") from None

    @property
    def recorded_name(self) -> str:
        """The name as recordings have it, without dynamics."""
        return str(replace(self, dynamics="mpm"))

    def __str__(self) -> str:
        sizes = ",".join(f"{name}={value:.6g}" for name, value in self.sizes)
        return self.problem + (f"({sizes})" if sizes else "") + ("" if self.dynamics == "mpm" else f"@{self.dynamics}")


def recorded_name(task: str) -> str:
    """The name that recordings of a task have: without its dynamics."""
    return TaskName.parse(task).recorded_name
