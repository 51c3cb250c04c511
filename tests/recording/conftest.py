"""Fixtures shared by the tests of recordings."""

import pytest

from app.core.messages import Episode
from tests.recording.samples import Maker, Recording, all_kinds, record


@pytest.fixture
def make() -> Maker:
    return Maker(seed=7)


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A recording of many chunks with all kinds of messages, and what was written to it."""
    make = Maker(seed=1)
    episode = make(Episode)
    messages = [make(kind) for _ in range(7) for kind in all_kinds() if kind is not Episode]
    path = record(tmp_path_factory.mktemp("whole"), episode, messages)
    return Recording(path=path, messages=[episode, *messages])
