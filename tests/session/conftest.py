"""Fixtures of all tests of the session: virtual time, and photographs of the small cell, taken before any loop runs."""

from collections.abc import Iterator
from typing import Any

import pytest

from tests.session.rig import photographs
from tests.session.virtual import VirtualLoop, install


@pytest.fixture(scope="package", autouse=True)
def _pictures_are_taken_beforehand() -> None:
    photographs()


@pytest.fixture(scope="package")
def anyio_backend() -> tuple[str, dict[str, Any]]:
    return "asyncio", {"loop_factory": VirtualLoop}


@pytest.fixture(scope="package")
def virtual_time() -> Iterator[None]:
    """Nothing is waited for, and nothing computed in other processes."""
    with pytest.MonkeyPatch.context() as patch:
        install(patch)
        yield
