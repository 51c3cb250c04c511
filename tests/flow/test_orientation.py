"""The belief about the object's ends goes from push to push, and the operator hears when they are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.messages import Model, Notice, Proposal, Transition
from app.core.orientation import UNKNOWN, Orientation
from tests.flow.cell import running, small_site, small_wish

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


async def test_the_ends_are_followed_through_every_push_and_it_is_said_once_when_they_are_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = list[tuple[Orientation, Transition]]()

    def followed(_: str, orientation: Orientation, made: Transition, model: Model) -> Orientation:
        told.append((orientation, made))
        return replace(orientation, log_odds=orientation.log_odds + 2.0, line=np.zeros((2, 5), np.float32))

    monkeypatch.setattr("app.flow.planning.followed", followed)
    async with running(small_site(tmp_path), small_wish()) as run:
        for _ in range(4):
            await run.person.decides(await run.person.sees(Proposal))
        await run.person.sees(Proposal)
        assert [known.log_odds for known, _ in told] == [0.0, 2.0, 4.0, 6.0]
        assert told[0][0] is UNKNOWN
        assert [made.id for _, made in told] == [made.id for made in run.person.all(Transition)]
        said = [notice.text for notice in run.person.all(Notice) if notice.where == "orientation"]
        assert len(said) == 1
        assert "probability of 0.98" in said[0]
