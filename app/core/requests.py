"""What an operator asks for besides modes and decisions. The program answers in words where it cannot do it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.charuco import Charuco
from app.core.checklist import ChecklistRequest
from app.core.control import EndRequest, Lease, ModeRequest
from app.core.messages import Decision, Message, MessageId, Model, Notice, ResumeRequest, StopRequest
from app.core.types import ColourImage, DepthImage, Points

GoalSource: TypeAlias = Literal["view", "curve", "copy", "region", "file"]
"""Where the points of a goal are from: the object as it lies now, a curve that it shall follow, a moved and bent copy
of it, a region that it shall fill, or a file."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class GoalRequest(Message):
    """The object shall be at `positions` (N, 3) [m], as many as there are."""

    operator: str
    source: GoalSource
    positions: Points


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PictureGoalRequest(Message):
    """The object shall be where this pair of images of the camera called `camera` shows it."""

    operator: str
    camera: str
    color: ColourImage
    depth: DepthImage


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EditRequest(Message):
    """The motion of a proposal, but beginning at `start` and ending at `end` [m]: to be simulated and offered.

    `branch`: whose motion of it; below zero, that of the one which was proposed.
    """

    operator: str
    proposal_id: MessageId
    start: Float64[np.ndarray, "3"]
    end: Float64[np.ndarray, "3"]
    branch: int = -1


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ModelRequest(Message):
    """Plan with this model from now on: one of a file, or an earlier version."""

    operator: str
    model: Model
    source: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ColourRequest(Message):
    """The object has these colours: bounds of hue [degree], saturation and value [0..1], low then high of each."""

    operator: str
    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]


TakeAct: TypeAlias = Literal["start", "success", "failure", "discard", "redo"]
"""Of a demonstration: begin one; end it with a verdict; end it and remove it; the same and begin another."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class TakeRequest(Message):
    """What to do with demonstrations."""

    operator: str
    act: TakeAct


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ClipRequest(Message):
    """The last `duration_s` shall be kept in a file of their own."""

    operator: str
    duration_s: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ProbeRequest(Message):
    """So many pushes shall be chosen for what they say about what the model lacks; 0: no further one is."""

    operator: str
    pushes: int


CalibrationAct: TypeAlias = Literal["begin", "take", "drop", "check", "save", "end"]
"""Of a camera's calibration: begin one; take a view; forget the last one; check what was kept by a fresh view; keep the
result; end it."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationRequest(Message):
    """What to do with the calibration of a camera, by a board with squares and markers of that size."""

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
    | CalibrationRequest
)
"""What takes the program a while."""
Asked: TypeAlias = ModeRequest | EndRequest | ChecklistRequest | Chore
"""What whoever has control may ask for."""
Request: TypeAlias = Decision | StopRequest | ResumeRequest | Lease | Notice | Asked
"""What comes from an operator; a notice is of something that the console saw, for the record."""
