"""The belief about the object's ends goes from push to push, and the operator hears when they are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.geometry.orientation import Orientation
from app.core.messages import MessageId, Model, Notice, Proposal, Transition
from tests.session.cell import running, small_site, small_wish

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TOLD = list[tuple[float, MessageId]]()
"""The odds before each push, and the push."""


def surer(_: str, orientation: Orientation, made: Transition, model: Model) -> Orientation:
    TOLD.append((orientation.log_odds, made.id))
    return replace(orientation, log_odds=orientation.log_odds + 2.0, line=np.zeros((2, 5), np.float32))


async def test_the_ends_are_followed_through_every_push_and_it_is_said_once_when_they_are_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    TOLD.clear()
    monkeypatch.setattr("app.session.planning.track_orientation", surer)
    async with running(small_site(tmp_path), small_wish()) as run:
        for _ in range(4):
            await run.person.decides(await run.person.sees(Proposal))
        await run.person.sees(Proposal)
        assert list(zip([0.0, 2.0, 4.0, 6.0], (made.id for made in run.person.all(Transition)), strict=True)) == TOLD
        said = [notice for notice in run.person.all(Notice) if notice.where == "orientation"]
        assert len(said) == 1
        assert said[0].cause == (TOLD[1][1],)
        assert "probability of 98 %" in said[0].text
