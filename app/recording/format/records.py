"""Stored forms of the messages that are not stored as they are.

Images and surface clouds are stored once, in Foxglove's own messages; an approval is never recreated from a file.
"""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Bool

from app.core.geometry.camera import CameraModel
from app.core.messages import Message, MessageId
from app.core.motion import Motion
from app.core.types import Points


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class FrameRecord(Message):
    """A `Frame` without its images, which precede it on the camera's own channels at the same log time."""

    camera: CameraModel


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ParticlesRecord(Message):
    """A `Particles` without its surface, which precedes it on the surface channel at the same log time."""

    positions: Points
    reconstruction_s: float
    predicted: Bool[np.ndarray, " P"] = field(default_factory=lambda: np.zeros(0, np.bool_))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ApprovalRecord(Message):
    """Record of an `Approved`. It moves nothing: only the approval gate makes an `Approved`."""

    proposal_id: MessageId
    motion: Motion
    digest: str
    operator: str
