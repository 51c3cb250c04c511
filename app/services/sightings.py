"""Sightings of tool and table, from the images of recordings that have none, as those of `dipac run`."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from app.core.messages import Frame, MessageId, Particles, Sighting, fresh_id
from app.perception.find_tool import Pose, find_tool
from app.perception.tool_and_table_points import table_points
from app.recording.read.reader import read_messages
from app.tasks.elements.base import Task


def look_beside(
    path: Path, tools: Mapping[MessageId, tuple[Particles, Pose]], tables: Mapping[MessageId, Particles], task: Task
) -> dict[float, Sighting]:
    """Sightings in the images behind some particles, of the tool (`tools`) and of the bare table (`tables`), by time.

    The recording's images are read through once, which takes some 10 ms each. Raises as `read_messages`.
    """
    wanted = {seen.id: seen for seen, _ in tools.values()} | dict(tables)
    owners = {frame: seen.id for seen in wanted.values() for frame in seen.cause}
    found, waiting = dict[float, Sighting](), dict[MessageId, list[Frame]]()
    for frame in read_messages(path, [Frame]) if wanted else ():
        if not isinstance(frame, Frame) or frame.id not in owners:
            continue
        seen = wanted[owners[frame.id]]
        frames = waiting.setdefault(seen.id, [])
        frames.append(frame)
        if len(frames) < len(seen.cause):
            continue
        del waiting[seen.id]
        tool = np.zeros((0, 3), np.float32)
        if seen.id in tools:
            tool = find_tool(frames, tools[seen.id][1], task.stage.tool, task.perception)
        table = table_points(frames, task.perception) if seen.id in tables else tool[:0]
        found[seen.time_s] = Sighting(
            id=fresh_id("sighting"), cause=seen.cause, time_s=seen.time_s, tool=tool, table=table
        )
    return found
