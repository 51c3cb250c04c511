"""Measuring the object on request: from what was seen lately, in a process of its own."""

from dataclasses import replace
from pathlib import Path

import anyio
import pytest

from app.core.dialogue.object_messages import MeasuredObject
from app.core.dialogue.requests import MeasureRequest
from app.core.messages import Notice, Particles, fresh_id
from app.tasks import load
from tests.session.cell import for_a_while, running, small_site, small_wish

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


def request() -> MeasureRequest:
    return MeasureRequest(id=fresh_id("measure"), time_s=anyio.current_time(), operator="tests")


async def test_the_rope_that_is_seen_is_measured_with_what_no_camera_sees_assumed(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True)) as run:
        await run.person.sees(Particles)
        await for_a_while(run)
        await run.person.asks(request())
        found = await run.person.sees(MeasuredObject)
        sizes = {size.name: size for size in found.sizes}
        assert abs(sizes["length_m"].value - 0.4) < 3 * sizes["length_m"].sd
        assert not sizes["mass_kg"].seen
        assert found.views > 2
        assert found.colours is not None
        await for_a_while(run)
        assert found in run.log.messages


async def test_what_is_out_of_sight_or_cannot_be_described_is_said(tmp_path: Path) -> None:
    async with running(small_site(tmp_path), small_wish(staying=True), place="covered") as run:
        await for_a_while(run)
        await run.person.asks(request())
        await run.person.sees(Notice, "Nothing was measured. Too little of the object is seen")
    soup = replace(small_wish(staying=True).task, stage=load("pour_soup").stage)
    async with running(small_site(tmp_path), replace(small_wish(staying=True), task=soup)) as run:
        await run.person.sees(Particles)
        await run.person.asks(request())
        await run.person.sees(Notice, "cannot be described")
