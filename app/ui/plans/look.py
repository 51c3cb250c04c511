"""View selection: two branches of a plan at a moment between now and their end. Pure."""

from dataclasses import dataclass
from typing import Final, NamedTuple, final

import numpy as np

from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Branch, Proposal
from app.core.types import Points

BEST: Final[str] = "the proposed one"
NONE: Final[str] = "none"


class BranchFrame(NamedTuple):
    """A branch at a moment: particles and the tool's tip [m], which is NaN where unknown."""

    particles: Points
    tool: np.ndarray


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PreviewState:
    """Branch `at` of `proposal`, beside branch `beside` or none, at `share` (0 now, 1 the end) of their horizon."""

    proposal: Proposal
    at: int
    beside: int | None = None
    share: float = 0.0

    @property
    def branch(self) -> Branch:
        """The chosen branch."""
        return self.proposal.branches[self.at]

    @property
    def other(self) -> Branch | None:
        """The branch compared with it."""
        return None if self.beside is None else self.proposal.branches[self.beside]

    def ghost(self, branch: Branch) -> BranchFrame:
        """Predicted state of `branch` at this moment: the nearest stored one."""
        particles, tools = moments(self.proposal, branch)
        index = round(self.share * (len(particles) - 1))
        return BranchFrame(particles[index], tools[index])


def selected_preview(proposal: Proposal, at: str, beside: str, moment: int) -> PreviewState:
    """Selection from the widgets' values; invalid ones become the proposed branch, none beside it, and now."""
    known = {name: index for index, name in enumerate(names(proposal))}
    branch = known.get(at, proposal.best)
    share = min(max(moment / last_moment(proposal), 0.0), 1.0)
    return PreviewState(proposal=proposal, at=branch, beside=known.get(beside), share=share)


def names(proposal: Proposal) -> tuple[str, ...]:
    """Unique names of the branches."""
    return tuple(f"{index} {branch.origin}" for index, branch in enumerate(proposal.branches, start=1))


def last_moment(proposal: Proposal) -> int:
    """Number of steps from now to the end, at least one."""
    return max(1, *(len(moments(proposal, branch)[0]) - 1 for branch in proposal.branches))


def moments(proposal: Proposal, branch: Branch) -> tuple[np.ndarray, np.ndarray]:
    """Particles (F, K, 3) and tool (F, 3) [m] at moments of a branch, the first of them now.

    Where no moments were stored, those that always are: now, after the first motion, and at the end.
    """
    if len(branch.frames):
        unknown = np.full((len(branch.frames), 3), np.nan)
        return branch.frames, branch.tools if len(branch.tools) == len(branch.frames) else unknown
    later = len(branch.actions) > 1
    seen = [proposal.observed, branch.predicted, *([branch.final] if later else [])]
    ends = branch.tool_path[[0, -1]] if len(branch.tool_path) else np.full((2, 3), np.nan)
    tools = np.concatenate([ends, np.full((1, 3), np.nan)])[: len(seen)]
    same = all(len(each) == len(seen[0]) for each in seen)
    return np.stack(seen if same else seen[1:]), tools if same else tools[1:]


def motion_at(branch: Branch, share: float) -> tuple[int, int]:
    """Number of the motion under way at `share` of the horizon, counted from 1, and their total."""
    count = max(len(branch.actions), 1)
    return min(max(int(np.ceil(share * count)), 1), count), count


def to_goal_m2(ghost: BranchFrame, goal: Points) -> float:
    """Squared Chamfer distance to the goal [m^2]; NaN where a branch became non-finite.

    For particles that were thinned a little more than for all of them.
    """
    return float(chamfer_m2(ghost.particles, goal)) if len(goal) and len(ghost.particles) else float("nan")
