"""The simulated cell in one process is a rig as any other: it passes their conformance suite, in virtual time."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import pytest

from app.core.ports import Rig
from tests.conformance.test_rigs import *  # noqa: F403
from tests.conformance.test_rigs import WANTED
from tests.rig.lockstep_rig import lockstep_rig
from tests.session.virtual import VirtualClock, VirtualLoop, install

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]


@pytest.fixture(scope="module")
def virtual_time() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        install(patch)
        yield


@pytest.fixture(scope="module")
def anyio_backend() -> tuple[str, dict[str, Any]]:
    return "asyncio", {"loop_factory": VirtualLoop}


@pytest.fixture(scope="module")
async def rig(anyio_backend: str, virtual_time: None) -> AsyncIterator[Rig]:
    wanted = {"stage": WANTED.stage, "start": WANTED.start, "site": WANTED.site, "seed": WANTED.seed}
    async with lockstep_rig(**wanted, clock=VirtualClock()) as rig:
        yield rig


@pytest.fixture
async def hang() -> Callable[[float], None]:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    return loop.hang
