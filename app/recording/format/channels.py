"""Mapping of message types to channels, shared by the writer and the reader."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.core.dialogue.approval import Approved
from app.core.dialogue.camera_calibration_messages import BoardSeen, Placing
from app.core.dialogue.checklist import Checklist, ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, Mode, ModeRequest
from app.core.dialogue.demonstration_messages import Take
from app.core.dialogue.model_monitor_messages import Verdict, Watched
from app.core.dialogue.object_messages import MeasuredObject
from app.core.dialogue.requests import (
    CalibrationRequest,
    ClipRequest,
    ColourRequest,
    DemonstrationRequest,
    EditRequest,
    GoalRequest,
    HandRequest,
    MeasureRequest,
    ModelRequest,
    PictureGoalRequest,
    ProbeRequest,
    StartPoseRequest,
    TakeRequest,
)
from app.core.dialogue.segmentation_message import Seen
from app.core.errors import RecordingError
from app.core.messages import (
    ArmState,
    Decision,
    Episode,
    Executed,
    Fault,
    Frame,
    Goal,
    Health,
    Message,
    Model,
    Notice,
    Outcome,
    Particles,
    Proposal,
    ResumeRequest,
    Sighting,
    StopRequest,
    Transition,
)
from app.recording.format.records import ApprovalRecord, FrameRecord, ParticlesRecord

SCHEMA_VERSION: Final = 2
"""Version of the schema, raised where an old reader could misread a new file; `migrate` leads from each to the next."""

METADATA: Final = "dipac"
"""Name of the metadata record that marks an MCAP file as a recording of this program."""

TOPICS: Final[Mapping[type[Message], str]] = MappingProxyType(
    {
        Episode: "/dipac/episode",
        Model: "/dipac/model",
        Goal: "/dipac/goal",
        Frame: "/dipac/frame",
        Particles: "/dipac/particles",
        Sighting: "/dipac/sighting",
        Proposal: "/dipac/proposal",
        Decision: "/dipac/decision",
        Approved: "/dipac/approved",
        Executed: "/dipac/executed",
        Transition: "/dipac/transition",
        Outcome: "/dipac/outcome",
        Verdict: "/dipac/verdict",
        Watched: "/dipac/watched",
        ArmState: "/dipac/arm_state",
        StopRequest: "/dipac/stop_request",
        ResumeRequest: "/dipac/resume_request",
        Lease: "/dipac/lease",
        Mode: "/dipac/mode",
        ModeRequest: "/dipac/mode_request",
        EndRequest: "/dipac/end_request",
        Checklist: "/dipac/checklist",
        ChecklistRequest: "/dipac/checklist_request",
        GoalRequest: "/dipac/goal_request",
        PictureGoalRequest: "/dipac/picture_goal_request",
        EditRequest: "/dipac/edit_request",
        ModelRequest: "/dipac/model_request",
        ColourRequest: "/dipac/colour_request",
        TakeRequest: "/dipac/take_request",
        ClipRequest: "/dipac/clip_request",
        ProbeRequest: "/dipac/probe_request",
        StartPoseRequest: "/dipac/start_pose_request",
        DemonstrationRequest: "/dipac/demonstration_request",
        HandRequest: "/dipac/hand_request",
        MeasureRequest: "/dipac/measure_request",
        MeasuredObject: "/dipac/measured_object",
        CalibrationRequest: "/dipac/calibration_request",
        BoardSeen: "/dipac/board_seen",
        Placing: "/dipac/placing",
        Take: "/dipac/take",
        Seen: "/dipac/seen",
        Health: "/dipac/health",
        Notice: "/dipac/notice",
        Fault: "/dipac/fault",
    }
)
"""The JSON channel of each message type."""

KINDS: Final[Mapping[str, type[Message]]] = MappingProxyType({topic: kind for kind, topic in TOPICS.items()})
"""The message type of each JSON channel."""

_RECORDS: Final[Mapping[type[Message], type[Message]]] = MappingProxyType(
    {Frame: FrameRecord, Particles: ParticlesRecord, Approved: ApprovalRecord}
)

SURFACE_TOPIC: Final = "/object/surface"


def topic_of(kind: type[Message]) -> str:
    """The JSON channel of a message type. Raises RecordingError where it has none."""
    try:
        return TOPICS[kind]
    except KeyError:
        raise RecordingError(f"Messages of type {kind.__name__} have no channel; add one to TOPICS.") from None


def record_of(kind: type[Message]) -> type[Message]:
    """The type whose fields are stored for messages of type `kind`."""
    return _RECORDS.get(kind, kind)


def color_topic(camera: str) -> str:
    """Channel of a camera's colour images."""
    return f"/camera/{camera}/color"


def depth_topic(camera: str) -> str:
    """Channel of a camera's depth images."""
    return f"/camera/{camera}/depth"


def part_topics(record: Message) -> list[str]:
    """The channels that hold the remaining parts of the message that `record` stands for."""
    match record:
        case FrameRecord(camera=camera):
            return [color_topic(camera.name), depth_topic(camera.name), calibration_topic(camera.name)]
        case ParticlesRecord():
            return [SURFACE_TOPIC]
        case _:
            return []


def calibration_topic(camera: str) -> str:
    """Channel of a camera's calibrations."""
    return f"/camera/{camera}/calibration"
