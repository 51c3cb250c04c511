"""Messages between the stages of the application: frozen, dated, and each naming its causes.

`cause` holds the ids of the messages this one was made from, so that any executed motion leads back to the frames,
particles, model version and plan behind it. `time_s` is `time.monotonic()`, which all processes of one machine share.
"""

import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NewType, Self, TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.core.geometry.camera import CameraModel
from app.core.motion import Motion
from app.core.types import (
    Cloud,
    ColourImage,
    DepthImage,
    Points,
    Poses,
    ToolPath,
    ToolPose,
)

MessageId = NewType("MessageId", str)


def fresh_id(kind: str) -> MessageId:
    """A new unique id with its kind, for example `frame-3f2a9c01d4`."""
    return MessageId(f"{kind}-{uuid.uuid4().hex[:10]}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Message:
    """Base of every message: its id, its causes, and its time."""

    id: MessageId
    cause: tuple[MessageId, ...] = ()
    time_s: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Frame(Message):
    """One RGB-D image pair. `time_s` is the moment of exposure."""

    camera: CameraModel
    color: ColourImage
    depth: DepthImage


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Particles(Message):
    """The object as particles of equal volume, with the fused surface they were made from.

    `time_s` is that of the oldest frame behind it; `cause` holds the frames' ids. `predicted`: mask of the particles
    that no camera sees now, held where they were last seen; empty where visibility is unknown.
    """

    positions: Points
    surface: Cloud
    reconstruction_s: float
    predicted: Bool[np.ndarray, " P"] = field(default_factory=lambda: np.zeros(0, np.bool_))

    @property
    def unseen(self) -> Cloud:
        """Positions of the particles that no camera sees now; none where visibility is unknown."""
        return self.positions[self.predicted] if len(self.predicted) == len(self.positions) else self.positions[:0]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting(Message):
    """Points of the tool and of the bare table in the same frames. Either may be empty.

    `time_s` and `cause` are those of the `Particles` made from these frames.
    """

    tool: Cloud
    table: Float32[np.ndarray, "L 3"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Goal(Message):
    """Goal state of the object, as particles."""

    positions: Points


@final
@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A physical parameter of the model with its 90 % interval (equal to the value where it was not estimated)."""

    name: str
    value: float
    unit: str
    low: float
    high: float


@final
@dataclass(frozen=True, kw_only=True)
class Extension:
    """Provenance of a model that discovery extended; empty for any other model.

    `effects`: the effects found, by name; `camera_m`: the centroid of the cameras [m], about which their errors are
    modelled; `covariance`: of the values of the parameters `estimated`, in products of their units; `recordings`: the
    SHA-256 of each file behind it, by its name.
    """

    effects: tuple[str, ...] = ()
    camera_m: tuple[float, ...] = ()
    estimated: tuple[str, ...] = ()
    covariance: tuple[tuple[float, ...], ...] = ()
    recordings: Mapping[str, str] = field(default_factory=dict[str, str])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Model(Message):
    """The simulator's physical parameters, version by version. Version 0 is the task's nominal model.

    `apparatus`: errors of cameras and arm, the parameters that are not at their null.
    """

    version: int
    task: str
    parameters: tuple[Parameter, ...]
    loss_m2: float = float("nan")
    transition_count: int = 0
    apparatus: tuple[Parameter, ...] = ()
    extension: Extension = Extension()

    def value(self, name: str) -> float:
        """The value of the simulator's parameter called `name`; KeyError where there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter.value
        raise KeyError(name)


Origin = Literal["policy", "part", "learned", "random", "continued", "sampled", "asked", "edited", "start", "shown"]
"""Source of a branch's actions: the task's own initial policy, a part of each of a policy's actions, a learned policy,
random sampling, the plan before, a fitted distribution, discovery, or the operator, who edited or asked for them."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Branch:
    """One branch of the search tree, before and after its actions were optimised.

    `actions (D, A)`: D steps deep, in the task's action space; `tool_path (W, 3)`: the first action's path;
    `predicted (N, 3)`: the particles after the first action; `final (N, 3)`: at the end of the branch.
    An `asked` one is a requested push, and is not scored: its costs are NaN.
    A branch that became non-finite is kept for the record with `finite=False` and is never chosen. `frames (F, K, 3)`:
    the particles at F moments of the branch, evenly spaced from now to its end, large objects thinned to every second,
    third, ... particle; `tools (F, 3)`: the tool's position at those moments. Older recordings have neither.
    """

    origin: Origin
    actions: Float32[np.ndarray, "D A"]
    tool_path: Float32[np.ndarray, "W 3"]
    predicted: Points
    final: Points
    cost_before: float
    cost_after: float
    terms: Mapping[str, float]
    finite: bool
    frames: Float32[np.ndarray, "F K 3"] = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))
    tools: Float32[np.ndarray, "F 3"] = field(default_factory=lambda: np.zeros((0, 3), np.float32))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Proposal(Message):
    """A plan offered for approval. `cause` holds the ids of the particles, the goal and the model behind it."""

    task: str
    particles_id: MessageId
    goal_id: MessageId
    model_id: MessageId
    model_version: int
    observed: Points
    branches: tuple[Branch, ...]
    best: int
    motion: Motion
    chamfer_m2: float
    predicted_chamfer_m2: float
    plan_s: float
    ahead: bool = False  # Made while the arm still moved, for where the object was predicted to lie.

    @property
    def chosen(self) -> Branch:
        """The branch that `motion` executes."""
        return self.branches[self.best]

    @property
    def is_improvement(self) -> bool:
        """True for a motion of lower cost than no motion, which costs 0, and for a requested one, which has no cost."""
        return not self.chosen.cost_after >= 0.0

    @property
    def dropped_count(self) -> int:
        """Number of branches that became non-finite."""
        return sum(not branch.finite for branch in self.branches)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Executed(Message):
    """Execution of an approved motion: commanded and measured tool poses, sampled at `times_s`.

    `measured` is empty in imported data without measured poses. `openings` [m] of the tool go with `made`; empty where
    it has none, or they are unknown.
    """

    approved_id: MessageId
    outcome: Literal["completed", "stopped", "fault"]
    reason: str
    times_s: Float64[np.ndarray, " T"]
    commanded: Poses
    measured: Float64[np.ndarray, "M 7"]
    openings: Float64[np.ndarray, " G"] = field(default_factory=lambda: np.zeros(0))

    @property
    def tool(self) -> ToolPath:
        """Path of the tool as executed, shape (T, 8)."""
        openings = self.openings if len(self.openings) else np.zeros(len(self.made))
        return np.concatenate([self.made, openings[:, None]], axis=1)

    @property
    def made(self) -> Float64[np.ndarray, "M 7"]:
        """The poses as measured, or as commanded where none were measured."""
        return self.measured if len(self.measured) else self.commanded


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Transition(Message):
    """The object before a motion, the motion as it was made, and the object after it."""

    before: Points
    executed: Executed
    after: Points

    @classmethod
    def between(
        cls,
        before: Particles,
        executed: Executed,
        after: Particles,
        *,
        named: MessageId | None = None,
        time_s: float | None = None,
    ) -> Self:
        """Transition between two observations; its time is that of `after` unless given."""
        return cls(
            id=named or fresh_id("transition"),
            cause=(before.id, executed.id, after.id),
            time_s=after.time_s if time_s is None else time_s,
            before=before.positions,
            executed=executed,
            after=after.positions,
        )


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome(Message):
    """One push in numbers, once the object has been seen again: prediction and result.

    `cause` holds the ids of the proposal, of the executed motion and of the particles seen afterwards; `index` counts
    the pushes of the episode from 1.
    """

    index: int
    chamfer_before_m2: float
    predicted_chamfer_m2: float
    chamfer_after_m2: float
    cost_before: float
    cost_after: float
    plan_s: float
    model_version: int


ArmMode: TypeAlias = Literal["idle", "moving", "stopping", "stopped", "fault"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ArmState(Message):
    """The arm as last measured. `period_s` is the longest control period since the previous state was read.

    `gripper`: 0 open to 1 closed, in the arm's own scale; `opening_m`: distance between its fingers, or the tool's.
    """

    pose: Float64[np.ndarray, "7"]
    velocity: Float64[np.ndarray, "3"]
    joints: Float64[np.ndarray, "7"]
    gripper: float
    mode: ArmMode
    period_s: float
    reason: str = ""
    opening_m: float = 0.0

    @property
    def tool(self) -> ToolPose:
        """The tool's pose and opening."""
        return np.array([*self.pose, self.opening_m])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Fault(Message):
    """A fault, in words, and the reaction to it."""

    where: str
    text: str
    fatal: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Notice(Message):
    """Something that the operator should read: a stage that started, a plan that was dropped."""

    where: str
    text: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Health(Message):
    """The health strip: ages and durations [s], the calibration loss, and counted drops by channel.

    `doing`: current activity of the program, in words, and for how long; `cameras`: problem of each faulty camera, by
    name.
    """

    doing: str
    frame_age_s: Mapping[str, float]
    particles_age_s: float
    plan_age_s: float
    plan_s: float
    arm_mode: ArmMode
    arm_period_s: float
    model_version: int
    calibration_loss_m2: float
    drops: Mapping[str, int]
    faults: int
    disk_free_bytes: int
    calibrating: bool = False
    cameras: Mapping[str, str] = field(default_factory=dict[str, str])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Episode(Message):
    """The start of a recording: what ran, with what, from which code."""

    task: str
    rig: str
    seed: int
    simulated: bool
    code_version: str
    config: str
    """The whole configuration as one JSON document."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Decision(Message):
    """An operator's decision on a proposal: the digest is that of the motion the console was showing."""

    proposal_id: MessageId
    digest: str
    approve: bool
    operator: str
    reason: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ResumeRequest(Message):
    """The operator's request to go on after a stop."""

    operator: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class StopRequest(Message):
    """Record of an operator's STOP. The arm has been stopped already; this is for the recording and the session."""

    operator: str
