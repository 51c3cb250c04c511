"""What the tests of recordings share."""

from pathlib import Path

import pytest

from app.core.messages import Episode, Message
from tests.recording.samples import Maker, all_kinds, record


@pytest.fixture
def make() -> Maker:
    return Maker(seed=7)


@pytest.fixture(scope="session")
def rich_recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Message]]:
    """A recording of many chunks with all kinds of messages, and what was written to it."""
    make = Maker(seed=1)
    episode = make(Episode)
    messages = [make(kind) for _ in range(3) for kind in all_kinds() if kind is not Episode]
    return record(tmp_path_factory.mktemp("rich"), episode, messages), [episode, *messages]
