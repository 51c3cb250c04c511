"""The full name of a task: the problem, its split, sizes of object and tool that are not the default, and dynamics."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, Self, TypeAlias, cast, final

from app.core.errors import UsageError

Split: TypeAlias = Literal["easy", "hard"]
"""Set of problems of a task; what its file has is easy."""

_WRITTEN = re.compile(
    r"(?P<problem>[^@()]+?)(?:-(?P<split>hard))?(?:\((?P<sizes>[^()]*)\))?(?:@(?P<dynamics>[^@()]+))?"
)


@final
@dataclass(frozen=True)
class TaskName:
    """PROBLEM-SPLIT(size=value,...)@DYNAMICS, where all but the problem may be left out.

    A recording is of a problem, its split and its sizes, whatever its pushes were planned with. A model is of dynamics
    besides, and of all splits: they have one object and one tool. `sizes`: [m], [kg] or [rad], by name; `dynamics`:
    "mpm", material points, or "rods"; the split is written where it is "hard".
    """

    problem: str
    sizes: tuple[tuple[str, float], ...] = ()
    dynamics: str = "mpm"
    split: Split = "easy"

    @classmethod
    def of(cls, problem: str, sizes: Mapping[str, float], dynamics: str = "mpm", split: Split = "easy") -> Self:
        """The name with its sizes in order, so that equal tasks have equal names."""
        return cls(problem, tuple(sorted((name, float(value)) for name, value in sizes.items())), dynamics, split)

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
            sizes, split = {name: float(value) for name, value in pairs}, cast("Split", found["split"] or "easy")
            return cls.of(found["problem"], sizes, found["dynamics"] or "mpm", split)
        except ValueError as error:
            form = "rope_push, or rope_push(length_m=0.3,radius_m=0.006)@rods"
            raise UsageError(f"{text!r} is no name of a task ({error}); give one such as {form}.") from None

    @property
    def recorded_name(self) -> str:
        """The name as recordings have it, without dynamics."""
        return str(replace(self, dynamics="mpm"))

    def __str__(self) -> str:
        sizes = ",".join(f"{name}={value:.6g}" for name, value in self.sizes)
        problems = self.problem + ("" if self.split == "easy" else f"-{self.split}")
        return problems + (f"({sizes})" if sizes else "") + ("" if self.dynamics == "mpm" else f"@{self.dynamics}")


def recorded_name(task: str) -> str:
    """The name that recordings of a task have: without its dynamics."""
    return TaskName.parse(task).recorded_name


def same_model(one: str, other: str, *, whole: bool = True) -> bool:
    """True if a model of the task `one` is one of `other`: of any split; where not `whole`, of any dynamics too."""
    names = (replace(TaskName.parse(each), split="easy") for each in (one, other))
    first, second = (each if whole else replace(each, dynamics="mpm") for each in names)
    return first == second
