"""Faults of a simulation by either engine: the first of each kind, and the states before it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, final

from app.sim.diagnosis.object_state import ObjectState

KEPT = 8
"""States before the end that are kept."""


class StepTable(Protocol):
    """Numbers of the states after 0, 1, 2, ... steps."""

    def __len__(self) -> int:
        """Number of states."""
        ...

    def columns(self) -> Mapping[str, Sequence[str]]:
        """The numbers for people, by name."""
        ...


TraceT = TypeVar("TraceT", bound=StepTable)
StateT = TypeVar("StateT", bound=ObjectState)


@final
@dataclass(frozen=True, kw_only=True)
class SimulationFault:
    """The first of its kind: after `step` steps, at the particle, node or segment `index`, in words."""

    kind: str
    step: int
    index: int
    words: str

    @classmethod
    def after(cls, kind: str, step: int, index: int, text: str, *, unit: str = "substep") -> "SimulationFault":
        """Fault in words that begin with the step: `text` is the rest of the sentence, without its full stop."""
        plural = unit if step == 1 else f"{unit}s"
        return cls(kind=kind, step=step, index=index, words=f"After {step} {plural} {text}.")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class FailureDiagnosis(Generic[TraceT, StateT]):
    """Diagnosis of a simulation that became non-finite.

    `failed`: the number of steps of the shortest rollout that is not finite; None if all are. `objection`: the defect
    of the input, if any. `advice`: the remedy, by the kind of the first fault. `last`: up to `KEPT` states before the
    failure or the end, shape (K, ...), the last of them after `until` steps; `trace` ends there.
    """

    steps: int
    unit: str
    failed: int | None
    objection: str | None
    faults: tuple[SimulationFault, ...]
    advice: Mapping[str, str]
    trace: TraceT
    last: StateT

    @property
    def until(self) -> int:
        """Number of steps after which the last finite state occurs."""
        return len(self.trace) - 1

    def verdict(self) -> str:
        """Diagnosis in a few sentences: the faults in order, and the remedy."""
        outcome = "Finite throughout" if self.failed is None else f"Not finite from {self.unit} {self.failed} on"
        story = [f"{outcome} ({self.steps} {self.unit}s).", *(fault.words for fault in self.faults)]
        if self.objection:
            story.insert(1, f"The input is wrong: {self.objection}")
        elif self.faults:
            story.append(f"What to change: {self.advice[self.faults[0].kind]}.")
        return " ".join(story)
