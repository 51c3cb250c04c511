"""Requests of an operator besides modes and decisions. The program answers in words where it cannot fulfil one."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.dialogue.checklist import ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, ModeRequest
from app.core.geometry.charuco import Charuco
from app.core.messages import Decision, Message, MessageId, Model, Notice, Proposal, ResumeRequest, StopRequest
from app.core.types import ColourImage, DepthImage, Points

GoalSource: TypeAlias = Literal["view", "curve", "copy", "region", "file"]
"""Source of a goal's points: the object as it lies now, a curve to follow, a moved and bent copy, a region to fill,
or a file."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class GoalRequest(Message):
    """Request for the goal `positions` (N, 3) [m], one for each particle of the object."""

    operator: str
    source: GoalSource
    positions: Points


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PictureGoalRequest(Message):
    """Request for the goal that this pair of images of the camera called `camera` shows."""

    operator: str
    camera: str
    color: ColourImage
    depth: DepthImage


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EditRequest(Message):
    """Request to simulate and offer the motion of a proposal, changed to begin at `start` and end at `end` [m].

    `branch`: index of the branch whose motion is edited; below zero, the proposed one.
    """

    operator: str
    proposal_id: MessageId
    start: Float64[np.ndarray, "3"]
    end: Float64[np.ndarray, "3"]
    branch: int = -1


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ModelRequest(Message):
    """Request to plan with this model from now on: one of a file, or an earlier version."""

    operator: str
    model: Model
    source: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ColourRequest(Message):
    """Request for new colours of the object: bounds of hue [degree], saturation and value [0..1], low then high."""

    operator: str
    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]


TakeAct: TypeAlias = Literal["start", "success", "failure", "discard", "redo"]
"""Command for a demonstration: begin; end with a verdict; end and remove; end, remove and begin another."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class TakeRequest(Message):
    """Command for the recording of demonstrations."""

    operator: str
    act: TakeAct


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ClipRequest(Message):
    """Request to keep the last `duration_s` in a file of their own."""

    operator: str
    duration_s: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ProbeRequest(Message):
    """Request for so many pushes that are chosen to be informative about the model's errors; 0 ends them."""

    operator: str
    pushes: int


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class StartPoseRequest(Message):
    """Request for the way to the pose in which the tool was as the session began."""

    operator: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class DemonstrationRequest(Message):
    """Request for the motions that were demonstrated, one after the other: those in `recording`, a file's name."""

    operator: str
    recording: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MeasureRequest(Message):
    """Request to measure the object, as far as cameras see it."""

    operator: str


HandAct: TypeAlias = Literal["take", "give"]
"""Command for moving by hand: take over from a motion that is being made, or give back."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class HandRequest(Message):
    """Request to move the tool by hand from now on, or to go on as before. The arm has been stopped for it before."""

    operator: str
    act: HandAct


CalibrationAct: TypeAlias = Literal["begin", "take", "drop", "check", "save", "end"]
"""Command for a camera's calibration: begin; take a view; drop the last one; check the stored result on a fresh
view; store the result; end."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationRequest(Message):
    """Command for the calibration of a camera, with a board of this square and marker size."""

    operator: str
    act: CalibrationAct
    camera: str
    square_m: float = Charuco().square_m
    marker_m: float = Charuco().marker_m


Chore: TypeAlias = (
    GoalRequest
    | PictureGoalRequest
    | EditRequest
    | ModelRequest
    | ColourRequest
    | TakeRequest
    | ClipRequest
    | ProbeRequest
    | StartPoseRequest
    | DemonstrationRequest
    | MeasureRequest
    | CalibrationRequest
)
"""Requests that take the program a while."""
Asked: TypeAlias = ModeRequest | EndRequest | ChecklistRequest | HandRequest | Chore
"""Requests open to the holder of control."""
Request: TypeAlias = Decision | StopRequest | ResumeRequest | Lease | Notice | Asked
"""Messages from an operator's console; a notice records something that the console observed."""


def is_requested(proposal: Proposal) -> bool:
    """True for a motion that an operator asked for: the way to the start pose, or one of a demonstration."""
    return proposal.chosen.origin in ("start", "shown")
