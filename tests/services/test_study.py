"""A recording becomes the pushes that were made, with what was seen before, during and after each."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.core.errors import RecordingError, UsageError
from app.core.geometry.camera import CameraModel
from app.core.messages import Episode, Executed, Frame, Message, Particles, Sighting, Transition
from app.discovery.dataset.study import Study
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.services.study import read_study
from app.tasks import load
from tests.perception.pushed import photographed, pushing
from tests.perception.test_gripper_fit import holding
from tests.recording.samples import Maker, record

PUSH_M = load("rope_push").finger.push_height_m
DOWN = (0.0, 1.0, 0.0, 0.0)
POINTS = 300


@pytest.fixture
def make() -> Maker:
    return Maker(seed=7)


def episode(make: Maker, task: str = "rope_push") -> Episode:
    return make(Episode, task=task)


def push(make: Maker, start_s: float) -> list[Message]:
    """Down, along and up in five seconds, seen every half second from `start_s` on, as the application records it."""
    rng = make.rng
    times = start_s + 1.0 + 0.01 * np.arange(500)
    heights = np.interp(times, start_s + 1.0 + np.array([0.0, 2.0, 3.0, 5.0]), [0.12, PUSH_M, PUSH_M, 0.12])
    poses = np.column_stack([np.linspace(0.4, 0.5, 500), np.zeros(500), heights, np.tile(DOWN, (500, 1))])
    executed = make(Executed, times_s=times, commanded=poses, measured=poses + 1e-4, outcome="completed")
    seen = [
        make(Particles, positions=rng.normal(0.5, 0.1, (POINTS, 3)).astype(np.float32), time_s=start_s + 0.5 * n)
        for n in range(15)
    ]
    before, after = seen[1], seen[14]
    made = make(
        Transition,
        cause=(before.id, executed.id, after.id),
        before=before.positions,
        executed=executed,
        after=after.positions,
    )
    return [*seen, executed, made]


def sighting(make: Maker, time_s: float, *, tool: int = 12, table: int = 40) -> Sighting:
    clouds = {name: make.rng.normal(size=(n, 3)).astype(np.float32) for name, n in (("tool", tool), ("table", table))}
    return make(Sighting, time_s=time_s, **clouds)


def study_of(folder: Path, *recordings: list[Message], **options: Any) -> Study:
    paths = list[Path]()
    for first, *others in recordings:
        assert isinstance(first, Episode)
        paths.append(record(folder, first, others))
    return read_study(paths, **options)


def test_a_push_has_the_views_at_which_the_tool_was_low_on_its_way(make: Maker, tmp_path: Path) -> None:
    study = study_of(tmp_path, [episode(make), *push(make, 100.0)])
    (made,) = study.pushes
    assert made.before.time_s == 100.5
    assert [view.time_s for view in made.during] == [103.0, 103.5, 104.0]
    assert made.after.time_s == 107.0
    assert made.measured is not None
    assert np.abs(made.measured.poses - made.command.poses).max() == pytest.approx(1e-4)


def test_what_was_seen_of_tool_and_table_stands_with_the_view_of_the_same_moment(make: Maker, tmp_path: Path) -> None:
    beside = [sighting(make, 103.5), sighting(make, 104.0, tool=0), sighting(make, 106.0, table=7)]
    study = study_of(tmp_path, [episode(make), *beside, *push(make, 100.0)])
    fingers = [view.finger for view in study.pushes[0].during]
    assert fingers[0] is None
    assert fingers[1] is not None
    assert np.array_equal(fingers[1], beside[0].tool)
    assert fingers[2] is None
    assert np.array_equal(study.tables[0], beside[0].table)


def test_an_episode_begins_with_each_message_that_says_so(make: Maker, tmp_path: Path) -> None:
    both = [episode(make), *push(make, 100.0), *push(make, 110.0), episode(make), *push(make, 120.0)]
    study = study_of(tmp_path, both, [episode(make), *push(make, 200.0)])
    assert [push.episode for push in study.pushes] == [0, 0, 1, 2]
    assert [push.before.time_s for push in study.pushes] == [100.5, 110.5, 120.5, 200.5]


def test_an_episode_whose_clock_began_anew_is_after_the_one_before(make: Maker, tmp_path: Path) -> None:
    study = study_of(tmp_path, [episode(make), *push(make, 100.0)], [episode(make), *push(make, 3.0)])
    early, late = study.pushes
    assert late.before.time_s > early.after.time_s
    assert late.after.time_s - late.before.time_s == pytest.approx(early.after.time_s - early.before.time_s)
    assert late.command.times_s[0] - late.before.time_s == pytest.approx(0.5)
    assert study.session_times().tolist() == [-0.5, 0.5]


def test_the_camera_is_in_the_middle_of_those_that_took_images(make: Maker, tmp_path: Path) -> None:
    frames = list[Message]()
    for name, y in (("left", 0.5), ("right", -0.3)):
        pose = np.eye(4)
        pose[:3, 3] = [0.5, y, 0.6]
        camera = make(CameraModel, name=name, T_world_camera=pose)
        frames.append(make(Frame, camera=camera))
    assert study_of(tmp_path, [episode(make), *frames, *push(make, 100.0)]).camera == pytest.approx((0.5, 0.1, 0.6))


def test_tool_and_table_are_looked_for_in_images_that_nobody_looked_at(make: Maker, tmp_path: Path) -> None:
    snapshot = pushing(3)
    frames = [replace(frame, time_s=103.5) for frame in photographed(snapshot, 3)]
    *seen, executed, made = push(make, 100.0)
    assert isinstance(executed, Executed)
    assert isinstance(made, Transition)
    poses = executed.measured.copy()
    poses[:, :2] = snapshot.tip[:2] + 0.003
    executed = replace(executed, measured=poses)
    causes = {103.5: tuple(frame.id for frame in frames)}
    particles = [replace(message, cause=causes.get(message.time_s, ())) for message in seen]
    study = study_of(tmp_path, [episode(make), *frames, *particles, executed, replace(made, executed=executed)])
    (finger,) = [view.finger for view in study.pushes[0].during if view.finger is not None]
    assert finger.mean(axis=0) == pytest.approx(snapshot.tip, abs=0.0015)
    assert len(study.tables[0]) == 400


def test_the_gripper_is_looked_for_with_the_opening_that_was_recorded(make: Maker, tmp_path: Path) -> None:
    snapshot = holding(0.3)
    cameras = SimulatedCameras(load("cloth_hang").stage, (), 3)
    frames = [replace(frame, time_s=103.5) for frame in cameras.look(snapshot, stamp_s=103.5, number=0)]
    *seen, executed, made = push(make, 100.0)
    assert isinstance(executed, Executed)
    assert isinstance(made, Transition)
    poses = np.tile(snapshot.tool[:7], (500, 1))
    executed = replace(executed, commanded=poses, measured=poses, openings=np.full(500, snapshot.tool[7]))
    causes = {103.5: tuple(frame.id for frame in frames)}
    particles = [replace(message, cause=causes.get(message.time_s, ())) for message in seen]
    recording = [episode(make, "cloth_hang"), *frames, *particles, executed, replace(made, executed=executed)]
    (carry,) = study_of(tmp_path, recording).pushes
    (gripper,) = [view.finger for view in carry.during if view.finger is not None]
    assert gripper.mean(axis=0) == pytest.approx(snapshot.tip, abs=3e-3)


def test_particles_that_are_not_in_the_recording_were_seen_when_the_motion_began_and_ended(
    make: Maker, tmp_path: Path
) -> None:
    alone = [message for message in push(make, 100.0) if not isinstance(message, Particles)]
    (made,) = study_of(tmp_path, [episode(make), *alone]).pushes
    assert (made.before.time_s, made.during, made.after.time_s) == (101.0, (), made.command.times_s[-1])


def test_recordings_of_other_tasks_are_refused(make: Maker, tmp_path: Path) -> None:
    ropes, beans = ([episode(make, task), *push(make, 100.0)] for task in ("rope_push", "bean_count"))
    with pytest.raises(UsageError, match="different tasks"):
        study_of(tmp_path, ropes, beans)
    with pytest.raises(UsageError, match="--task bean_count contradicts"):
        study_of(tmp_path, ropes, task="bean_count")
    with pytest.raises(UsageError, match="Unknown task 'bean_count'"):
        study_of(tmp_path, beans)
    with pytest.raises(UsageError, match="at least one recording"):
        read_study([])


def test_a_recording_without_a_push_says_what_to_do(make: Maker, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no finished push.*dipac run rope_push"):
        study_of(tmp_path, [episode(make)])


def test_half_a_file_is_to_be_recovered_first(make: Maker, tmp_path: Path) -> None:
    path = record(tmp_path, episode(make), push(make, 100.0))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(RecordingError, match="dipac recover"):
        read_study([path])


def test_a_cloud_of_hardly_any_points_is_refused(make: Maker, tmp_path: Path) -> None:
    *others, made = push(make, 100.0)
    assert isinstance(made, Transition)
    with pytest.raises(RecordingError, match="5 points are too few"):
        study_of(tmp_path, [episode(make), *others, replace(made, before=made.before[:5], after=made.after[:5])])


def test_a_cloth_is_read_where_the_openings_of_the_gripper_are_recorded_and_nowhere_else(
    make: Maker, tmp_path: Path
) -> None:
    *seen, executed, made = push(make, 100.0)
    assert isinstance(executed, Executed)
    assert isinstance(made, Transition)
    told = {True: np.full(500, 0.004), False: np.zeros(0)}
    recordings = {
        known: [episode(make, "cloth_hang"), *seen, replace(made, executed=replace(executed, openings=openings))]
        for known, openings in told.items()
    }
    (carry,) = study_of(tmp_path / "known", recordings[True]).pushes
    assert (carry.command.poses[:, 7] == 0.004).all()
    with pytest.raises(RecordingError, match="how far the gripper is open is not recorded"):
        study_of(tmp_path / "unknown", recordings[False])
