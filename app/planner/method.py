"""Choice of planner and its ablations: plain data, made into a planner by `app.planner.methods`."""

from __future__ import annotations

import pkgutil
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Self, final

from app.core.errors import UsageError
from app.planner import methods

if TYPE_CHECKING:  # Whoever needs these names alone shall not load JAX for them.
    from app.policy.learned.base import LearnedPolicy

PAPER = "dipac"
"""The planner of the paper, of which all ablations are."""
NO_REMAINDER = "no_remainder"
"""Each decision begins anew: it leaves nothing out where plans are one action long."""
NO_ONLINE = "no_online"
"""The paper's DiPac-Online without what sets it apart: it leaves nothing out where no model learns while it is used."""

ABLATIONS = MappingProxyType(
    {
        "no_calibration": {"calibrated": False},
        "no_optimisation": {"descending": False},
        "no_planning": {"branching": False, "descending": False},
        "no_policy": {"guided": False},
        NO_REMAINDER: {"continuing": False},
        NO_ONLINE: {"following": False},
    }
)
"""Ablations of the paper: the name of each, and the options it changes."""


@final
@dataclass(frozen=True, kw_only=True)
class Method:
    """Planning method. `planner`: a file of `app/planner/methods`.

    `descending`: actions are optimised along their gradient; without, the best branch is executed as it was sampled.
    `branching`: there are branches besides the policy's. `guided`: the initial policy takes part; without, all actions
    are drawn at random. Neither branching nor descending, the policy's action is executed as it is, and simulated only
    for display. `continuing`: it starts from the remainder of the last plan, too. `calibrated`: the model is
    calibrated; without, it is the simulator's without any demonstration. `following`: it goes on learning in use. Both
    are for the owner of the model to act on. `policy`: a learned one instead of the task's own.

    Raises UsageError for a planner that does not exist, and for options that make no sense together.
    """

    planner: str = PAPER
    descending: bool = True
    branching: bool = True
    guided: bool = True
    continuing: bool = True
    calibrated: bool = True
    following: bool = True
    policy: LearnedPolicy | None = None

    def __post_init__(self) -> None:
        """Checks that there is such a method."""
        if self.planner not in planners():
            raise UsageError.unknown("planner", self.planner, planners())
        if not (self.guided or self.branching):
            raise UsageError("Without initial policy and without branches beside its own nothing is left to plan with.")
        if self.planner != PAPER and not (self.descending and self.branching and self.guided):
            raise UsageError(f"Only {PAPER} has parts to leave out; {self.planner} can do without calibration alone.")
        if self.policy is not None and not (self.guided and self.planner == PAPER):
            raise UsageError(f"A learned policy guides {PAPER} alone, and not without a policy; leave out one of both.")

    @property
    def alone(self) -> bool:
        """True if the policy's actions are executed as they are."""
        return not (self.branching or self.descending)

    @classmethod
    def of(cls, planner: str = PAPER, ablation: str | None = None) -> Self:
        """The method of these names. Raises UsageError with the known ones, and for an ablation that is not of it."""
        if ablation is None:
            return cls(planner=planner)
        if ablation not in ABLATIONS:
            raise UsageError.unknown("ablation", ablation, ABLATIONS)
        return replace(cls(planner=planner), **ABLATIONS[ablation])


def planners() -> list[str]:
    """The names of all planners: the files of their folder."""
    return sorted(module.name for module in pkgutil.iter_modules(methods.__path__))


DIPAC = Method()
"""The paper's, whole."""
