"""A recording entered at any moment tells the same as one that was watched from its beginning."""

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from app.core.dialogue.approval import Approved
from app.core.errors import RecordingError, UsageError
from app.core.messages import Decision, Episode, Executed, Frame, Message, Notice, Proposal, Transition
from app.recording.library.recover import recover
from app.recording.read.timeline import Timeline, open_timeline
from app.ui.parts.console_state import ConsoleState
from tests.recording.demonstrations import PUSHES, demonstration
from tests.recording.samples import Maker, Recording, record, same


def folded(messages: list[Message], state: ConsoleState | None = None) -> ConsoleState:
    """But for the ids of plans that are gone, and for former colours: in a replay nobody goes back to those."""
    known = reduce(ConsoleState.after, messages, state or ConsoleState(replay=True))
    return replace(known, decided=(), colours=known.colours[-1:])


def session(make: Maker) -> list[Message]:
    """Plans that come up before the last motion is forgotten, decisions, notices that withdraw a plan."""
    told = list[Message]()
    for motion in range(6):
        plan = make(Proposal, cause=())
        told += [make(Frame, cause=()), plan]
        if motion % 3 == 1:
            told += [make(Notice, cause=(plan.id,)), make(Decision, cause=(), proposal_id=plan.id, approve=False)]
            continue
        told += [make(Decision, cause=(), proposal_id=plan.id, approve=True), make(Approved), make(Executed, cause=())]
        told += [make(Transition, cause=()) for _ in range(1 + motion % 2)]
    return told


@pytest.fixture(scope="module", params=["all kinds", "session", "demonstration", "recovered"])
def timeline(
    request: pytest.FixtureRequest, recording: Recording, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Timeline]:
    folder, make = tmp_path_factory.mktemp("timeline"), Maker(seed=3)
    match request.param:
        case "all kinds":
            path = recording.path
        case "session":
            path = record(folder, make(Episode, cause=()), session(make))
        case "demonstration":
            path = demonstration(folder)
        case _:
            cut = folder / "cut.mcap"
            cut.write_bytes(recording.path.read_bytes()[: recording.path.stat().st_size * 2 // 3])
            path = recover(cut).path
    with open_timeline(path) as timeline:
        yield timeline


def moments(timeline: Timeline, count: int = 12) -> list[float]:
    return sorted(np.random.default_rng(0).uniform(0, timeline.duration_s, count).tolist())


def test_a_jump_shows_what_watching_from_the_beginning_shows(timeline: Timeline) -> None:
    for time_s in [0.0, *moments(timeline), timeline.duration_s, *(mark.time_s for mark in timeline.marks[:20])]:
        assert same(folded(timeline.at(time_s)), folded(timeline.between(-1.0, time_s)))


def test_going_on_from_a_jump_shows_what_a_jump_further_on_shows(timeline: Timeline) -> None:
    for before_s, after_s in itertools.pairwise(moments(timeline)):
        here = folded(timeline.at(before_s))
        assert same(folded(timeline.gist(before_s, after_s), here), folded(timeline.at(after_s)))
        assert same(folded(timeline.between(before_s, after_s), here), folded(timeline.at(after_s)))


def test_what_lies_between_moments_is_everything_once(timeline: Timeline) -> None:
    bounds = [-1.0, *moments(timeline), timeline.duration_s]
    pieces = [message.id for a, b in itertools.pairwise(bounds) for message in timeline.between(a, b)]
    assert pieces == [message.id for message in timeline.between(-1.0, timeline.duration_s)]
    assert len(pieces) == len(set(pieces))
    assert timeline.between(0.5 * timeline.duration_s, 0.0) == []


def test_a_jump_reads_no_more_images_than_there_are_cameras(timeline: Timeline) -> None:
    frames = [message for message in timeline.at(timeline.duration_s) if isinstance(message, Frame)]
    assert len(frames) == len({frame.camera.name for frame in frames})


def test_marks_say_where_motions_begin_and_end(tmp_path: Path) -> None:
    make = Maker(seed=3)
    with open_timeline(record(tmp_path, make(Episode, cause=()), session(make))) as timeline:
        said = [(mark.kind, mark.text) for mark in timeline.marks if mark.kind in ("plan", "motion", "end")]
        assert said[:5] == [
            ("plan", "plan 1"),
            ("motion", "motion 1"),
            ("end", "motion 1 ends"),
            ("plan", "plan 2"),
            ("plan", "plan 3"),
        ]
        assert [mark.time_s for mark in timeline.marks] == sorted(mark.time_s for mark in timeline.marks)
        for mark in timeline.marks:
            if mark.kind == "plan":
                assert timeline.at(mark.time_s)[-1].id == folded(timeline.at(mark.time_s)).pending.id  # pyright: ignore


def test_the_plan_about_a_moment_is_the_one_in_force_or_the_next(tmp_path: Path) -> None:
    make = Maker(seed=3)
    told = session(make)
    plans = [message for message in told if isinstance(message, Proposal)]
    with open_timeline(record(tmp_path, make(Episode, cause=()), told)) as timeline:
        up = [mark.time_s for mark in timeline.marks if mark.kind == "plan"]
        ends = [mark.time_s for mark in timeline.marks if mark.kind == "end"]

        def about(time_s: float) -> str:
            found = timeline.plan_about(time_s)
            assert found is not None
            return found.id

        assert about(0.0) == plans[0].id
        assert about(up[0]) == plans[0].id
        assert about(ends[0]) == plans[1].id
        assert about(timeline.duration_s) == plans[-1].id
    with open_timeline(demonstration(tmp_path)) as timeline:
        assert timeline.plan_about(0.0) is None


def test_the_clock_is_the_one_that_messages_are_dated_by(tmp_path: Path) -> None:
    make = Maker(seed=3)
    before_s = time.monotonic()
    path = record(tmp_path, make(Episode, cause=()), [make(Notice, cause=(), time_s=time.monotonic())])
    with open_timeline(path) as timeline:
        assert before_s <= timeline.clock(0.0) <= timeline.clock(timeline.duration_s) <= time.monotonic()


def test_a_demonstration_has_a_mark_for_each_push_and_says_what_ran(tmp_path: Path) -> None:
    with open_timeline(demonstration(tmp_path)) as timeline:
        assert [mark.text for mark in timeline.marks if mark.kind == "motion"] == ["motion 1", "motion 2", "motion 3"]
        assert [mark.text for mark in timeline.marks if mark.kind == "seen"][-1] == f"the object after motion {PUSHES}"
        assert timeline.marks[-1].text == "camera: It was late."
        assert timeline.episode(0.0).task == "rope_push"


def test_of_several_episodes_the_one_that_ran_then_is_named(tmp_path: Path) -> None:
    make = Maker(seed=3)
    first, second = make(Episode, cause=(), task="rope_push"), make(Episode, cause=(), task="cloth_hang")
    with open_timeline(record(tmp_path, first, [make(Notice, cause=()), second])) as timeline:
        assert timeline.episode(0.0).task == "rope_push"
        assert timeline.episode(timeline.duration_s).task == "cloth_hang"


def test_reading_it_is_told(recording: Recording) -> None:
    told = list[float]()
    with open_timeline(recording.path, told.append):
        pass
    assert told == sorted(told)
    assert 0.0 <= told[0] <= told[-1] <= 1.0


def test_what_cannot_be_replayed_names_the_next_step(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="Unknown recording"), open_timeline(tmp_path / "none.mcap"):
        pass
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recording.path.read_bytes()[:-1])
    with pytest.raises(RecordingError, match=rf"`dipac recover {cut}`"), open_timeline(cut):
        pass


def test_damage_is_found_where_it_is_shown(tmp_path: Path) -> None:
    make = Maker(seed=3)
    frames = [replace(make(Frame, cause=()), id=f"frame-{number}") for number in range(8)]
    path = record(tmp_path, make(Episode, cause=()), frames)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with open_timeline(path) as timeline:
        assert timeline.at(0.0)
        with pytest.raises(RecordingError, match=rf"`dipac recover {path}`"):
            timeline.between(0.0, timeline.duration_s)
