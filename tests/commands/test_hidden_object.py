"""A view in which the tool hides the object that it holds: none of a cloth, and of water the one before."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.commands import _hiding
from app.commands._hiding import PushRecordingConfig, Scribe, Stopwatch
from app.core.errors import PerceptionError
from app.core.geometry.track import Track
from app.core.messages import Frame, Message, MessageId, Particles, Transition
from app.core.types import Cloud
from app.policy.random_carries import carry_design
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.push_session import PushSample, StampedSnapshot
from app.rig.simulated.testbeds import find_testbed
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot
from app.tasks import load

AT = np.array([0.55, -0.15, 0.28, 0.0, 1.0, 0.0, 0.0, 0.004])
X = np.random.default_rng(0).normal((0.55, -0.15, 0.2), 0.02, (128, 3)).astype(np.float32)
HIDDEN_AT_S = 1.0


def particles(name: str, time_s: float, cause: tuple[MessageId, ...] = ()) -> Particles:
    return Particles(
        id=MessageId(name),
        cause=cause,
        time_s=time_s,
        positions=X + np.float32(time_s),
        surface=X,
        reconstruction_s=0.0,
    )


def told(task: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> Sequence[Message]:
    """Messages of a motion in whose middle the object is hidden from the cameras."""

    views = iter((None, particles("seen", 2.0)))

    def reconstruct(*_: Any) -> Particles:
        found = next(views)
        if found is None:
            raise PerceptionError("nothing is seen")
        return found

    def no_images(*_: Any, **__: Any) -> list[Frame]:
        return []

    def no_tool(*_: Any) -> Cloud:
        return np.zeros((0, 3), np.float32)

    monkeypatch.setattr(_hiding, "reconstruct", reconstruct)
    monkeypatch.setattr(_hiding, "find_tool", no_tool)
    monkeypatch.setattr(SimulatedCameras, "look", no_images)
    known = load(task)
    physics = mistune(0, body=find_testbed(known).body(known))
    config = PushRecordingConfig(
        task=known, plan=carry_design(1, 1), physics=physics, hidden=(), seed=0, folder=folder, cameras=1
    )
    nodes, joints = X.astype(np.float64), solve_joints(AT)
    begin, middle, end = (
        StampedSnapshot(stamp_s=at, snapshot=Snapshot(time_s=at, nodes=nodes, tool=AT, joints=joints), told=AT)
        for at in (0.0, HIDDEN_AT_S, 2.0)
    )
    track = Track(times_s=np.array([0.5, 1.5]), poses=np.stack([AT, AT]))
    made = PushSample(episode=0, before=begin, during=middle, after=end, command=track, measured=track)
    return Scribe(config, Stopwatch()).after(particles("before", 0.0), made, 0)


def test_of_a_cloth_that_is_hidden_in_a_motion_no_view_is_recorded(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    messages = told("cloth_hang", monkeypatch, tmp_path)
    assert [each.time_s for each in messages if isinstance(each, Particles)] == [2.0]
    assert isinstance(messages[-1], Transition)


def test_water_that_is_hidden_in_a_motion_is_as_it_was(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    messages = told("pour_water", monkeypatch, tmp_path)
    during, after = (each for each in messages if isinstance(each, Particles))
    assert (during.time_s, after.time_s) == (HIDDEN_AT_S, 2.0)
    assert np.array_equal(during.positions, X)
