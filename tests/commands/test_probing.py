"""Experiments in the simulated cell: a push is made once it is approved, and until then the same look counts."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.commands import _probing
from app.commands._hiding import PushRecordingConfig
from app.commands._probing import ProbedCell, believed_of
from app.config import Site
from app.core.errors import PlanningError, UsageError
from app.core.geometry.track import Track
from app.core.messages import Frame, Particles
from app.discovery.dataset.study import ProjectionView
from app.discovery.experiments.probe import Belief
from app.discovery.experiments.probe_pushes import Probe
from app.policy.random_pushes import PushDesign, random_track
from app.recording.read.reader import read_messages, read_transitions
from app.rig.simulated.effect_sampling import mistune
from app.tasks import load

TASK = load("rope_push@rods")
PLAN = PushDesign(episodes=1, pushes=2)


@pytest.fixture
def held() -> Belief:
    return believed_of(TASK, None)


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch, held: Belief) -> list[Belief]:
    """Beliefs that pushes are chosen for; the choice is random, as the right one takes a minute."""
    beliefs = list[Belief]()

    def next_probe(task: str, belief: Belief, seen: ProjectionView, *rest: object) -> Probe:
        beliefs.append(belief)
        track = track_for(seen.points, seen.time_s + 0.5, len(beliefs))
        count = len(held.pull)
        return Probe(
            track=track,
            text=f"Push {len(beliefs)}",
            nats=0.5,
            between=("a", "b"),
            information=np.eye(count),
            predicted=seen.points,
        )

    monkeypatch.setattr(_probing, "next_probe", next_probe)
    return beliefs


def track_for(points: np.ndarray, start_s: float, seed: int) -> Track:
    return random_track(np.random.default_rng(seed), points, PLAN, start_s=start_s, height_m=0.006)


def cell(folder: Path, answers: Iterable[bool], *asked: Track) -> tuple[ProbedCell, list[str]]:
    """The cell, and the texts of what it asks, which are answered one after the other."""
    texts, left = list[str](), iter(answers)

    def approve(text: str) -> bool:
        texts.append(text)
        return next(left)

    task = load(TASK.recorded_name)
    session = PushRecordingConfig(task=task, plan=PLAN, physics=mistune(3), hidden=(), seed=3, folder=folder)
    folder.mkdir()
    return ProbedCell(session, TASK, site=Site(), approve=approve, asked=asked), texts


def test_another_push_is_offered_for_the_same_look_until_one_is_approved(
    tmp_path: Path, held: Belief, chosen: list[Belief]
) -> None:
    probed, texts = cell(tmp_path / "out", [False, False, True, True])
    probed.play(held, 2)
    assert texts == ["Push 1", "Push 2", "Push 3", "Push 4"]
    (path,) = probed.recordings
    assert len(read_transitions(path)) == 2
    messages = list(read_messages(path, [Frame, Particles]))
    assert len({message.id for message in messages}) == len(messages)
    assert sum(isinstance(message, Frame) for message in messages) == 2
    # What a push that is made will tell is counted on; what a rejected one would have told is not.
    pending = [float(np.trace(belief.pending - held.pending)) / len(held.pull) for belief in chosen]
    assert pending == [0, 0, 0, 1]


def test_an_experiment_ends_where_every_push_is_rejected_and_keeps_what_is_recorded(
    tmp_path: Path, held: Belief, chosen: list[Belief]
) -> None:
    probed, texts = cell(tmp_path / "out", [True, *[False] * 20])
    with pytest.raises(UsageError, match="20 pushes were rejected in a row"):
        probed.play(held, 2)
    assert len(texts) == 21
    (path,) = probed.recordings
    assert len(read_transitions(path)) == 1


def test_pushes_that_were_asked_for_come_first_and_one_that_cannot_be_made_is_left_out(
    tmp_path: Path, held: Belief, chosen: list[Belief]
) -> None:
    there = np.array([[0.45, -0.1, 0.0], [0.55, 0.1, 0.0]], np.float32)
    fits = track_for(np.linspace(*there, 50).astype(np.float32), 0.0, 1)
    outside = fits.with_positions(1.0 + 100.0 * (fits.positions - fits.positions[0]))
    probed, texts = cell(tmp_path / "out", [True, True], outside, fits)
    probed.play(held, 2)
    assert texts == ["A push that you asked for", "Push 1"]


def test_a_random_push_is_offered_where_none_can_be_chosen(
    tmp_path: Path, held: Belief, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*_: object) -> Iterator[Probe]:
        raise PlanningError("none may be made")

    monkeypatch.setattr(_probing, "next_probe", none)
    probed, texts = cell(tmp_path / "out", [False, True])
    probed.play(held, 1)
    assert [text.split(",")[0] for text in texts] == ["A random push"] * 2
    assert len(read_transitions(probed.recordings[0])) == 1
