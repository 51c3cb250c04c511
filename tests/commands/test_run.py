"""The words in which `dipac run` says what came of it."""

from pathlib import Path

import numpy as np
import pytest

from app.commands._episode import EpisodeReport, RunOptions
from app.commands.run import run
from app.core.dialogue.summary import Summary
from app.core.messages import Particles, fresh_id
from app.ui.terminal import Output

GOAL = np.zeros((1, 3), dtype=np.float32)


def _beside(offset_m: float) -> Particles:
    """One particle at a distance of the goal's one."""
    place = np.array([[offset_m, 0.0, 0.0]], dtype=np.float32)
    id_ = fresh_id("particles")
    return Particles(id=id_, cause=(), time_s=0.0, positions=place, surface=place, reconstruction_s=0.0)


def _words_of(summary: Summary, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    async def episode(order: RunOptions, _output: Output) -> EpisodeReport:
        return EpisodeReport(
            order=order, rig="simulated", summary=summary, recording=Path("r"), recorded=0, failure=None
        )

    monkeypatch.setattr("app.commands.run.episode", episode)
    run("rope_push")
    return capsys.readouterr().out


def test_the_distance_is_of_what_was_seen_last_also_where_the_last_push_was_stopped(monkeypatch, capsys):
    summary = Summary()
    for offset_m in (0.080, 0.0137, 0.009):  # The start; after a push that is scored; after one that was stopped.
        summary.saw(_beside(offset_m), GOAL)
    summary.chamfer_m2.append(2 * 0.0137**2)
    summary.reached = True
    assert "80.0 mm -> 9.0 mm from the goal" in (words := _words_of(summary, monkeypatch, capsys))
    assert f"fell to {(9 / 80) ** 2:.0%} of its start" in words
    assert summary.chamfer_m2 == pytest.approx([2 * 0.080**2, 2 * 0.0137**2])


def test_where_nothing_was_seen_no_distance_is_said(monkeypatch, capsys):
    assert "from the goal" not in _words_of(Summary(), monkeypatch, capsys)
