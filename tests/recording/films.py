"""Recordings of cameras at times of their own, as a film is cut from them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from app.core.geometry.camera import CameraModel
from app.core.messages import ArmState, Episode, Frame, Message, fresh_id
from app.recording.write.file import EpisodeFile
from tests.recording.samples import Maker

BEGIN_S = 1000.0
WIDTH, HEIGHT = 32, 24


def camera(name: str, make: Maker, **fields: Any) -> CameraModel:
    """A small camera of that name."""
    return replace(make(CameraModel, name=name, width=WIDTH, height=HEIGHT), depth_unit_m=0.001, **fields)


def frame(model: CameraModel, time_s: float, number: int) -> Frame:
    """Frame of one grey and one depth that encode its number."""
    color = np.full((model.height, model.width, 3), 10 * number % 250, np.uint8)
    depth = np.full((model.height, model.width), number, np.uint16)
    return Frame(id=fresh_id("frame"), time_s=time_s, camera=model, color=color, depth=depth)


def frames(times_s: Mapping[str, Sequence[float]], make: Maker) -> list[Frame]:
    """Frames of each camera at its times, counted from the beginning, numbered from 1; in the order of time."""
    found = list[Frame]()
    for name, times in times_s.items():
        model = camera(name, make)
        found += [frame(model, BEGIN_S + time_s, number) for number, time_s in enumerate(times, start=1)]
    return sorted(found, key=lambda each: each.time_s)


def filmed(path: Path, messages: Sequence[Message], make: Maker, *, rig: str = "some rig") -> Path:
    """A whole recording of the messages, each logged at its own time."""
    episode = make(Episode, cause=(), time_s=BEGIN_S, rig=rig)
    file = EpisodeFile(path, episode)
    file.write(episode, now_s=BEGIN_S)
    for message in messages:
        file.write(message, now_s=message.time_s)
    file.close()
    return path


def states(times_s: Sequence[float], make: Maker) -> list[ArmState]:
    """States of an arm at these times from the beginning."""
    return [make(ArmState, cause=(), time_s=BEGIN_S + time_s) for time_s in times_s]
