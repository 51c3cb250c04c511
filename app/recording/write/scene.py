"""Paths of the tool as lines in Foxglove's 3-D panel."""

import numpy as np
from foxglove.messages import (
    Color,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    Timestamp,
)

from app.core.messages import Proposal

_CHOSEN = Color(r=0.10, g=0.75, b=0.30, a=1.0)
_OTHER = Color(r=0.55, g=0.55, b=0.60, a=0.5)
_NON_FINITE = Color(r=0.85, g=0.15, b=0.15, a=0.8)
_EXECUTED = Color(r=0.15, g=0.45, b=0.90, a=1.0)
_THICK_PX, _THIN_PX = 4.0, 1.5


def branch_lines(proposal: Proposal, stamp: Timestamp, frame: str) -> SceneUpdate:
    """The first action of every branch; the chosen one is thick and green, a non-finite one red."""
    entities: list[SceneEntity] = []
    for index, branch in enumerate(proposal.branches):
        chosen = index == proposal.best
        color = _CHOSEN if chosen else _OTHER if branch.finite else _NON_FINITE
        line = _line(branch.tool_path, color, _THICK_PX if chosen else _THIN_PX)
        entities.append(SceneEntity(timestamp=stamp, frame_id=frame, id=f"branch-{index}", lines=[line]))
    return _instead(entities, stamp)


def path_line(positions: np.ndarray, stamp: Timestamp, frame: str) -> SceneUpdate:
    """Line through the tool's positions [m], shape (T, 3)."""
    line = _line(positions, _EXECUTED, _THICK_PX)
    return _instead([SceneEntity(timestamp=stamp, frame_id=frame, id="executed", lines=[line])], stamp)


def _instead(entities: list[SceneEntity], stamp: Timestamp) -> SceneUpdate:
    """`entities` in place of everything that the channel showed before."""
    return SceneUpdate(
        deletions=[SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletionType.All)], entities=entities
    )


def _line(positions: np.ndarray, color: Color, thickness_px: float) -> LinePrimitive:
    """A line through the finite ones of `positions` [m] `(W, 3)`."""
    finite = positions[np.isfinite(positions).all(axis=1)]
    return LinePrimitive(
        type=LinePrimitiveLineType.LineStrip,
        thickness=thickness_px,
        scale_invariant=True,
        points=[Point3(x=x, y=y, z=z) for x, y, z in finite.tolist()],
        color=color,
    )
