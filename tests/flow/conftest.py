"""What every test of the flow has: photographs of the small cell, taken before any loop runs."""

import pytest

from tests.flow.rig import photographs


@pytest.fixture(scope="package", autouse=True)
def _pictures_are_taken_beforehand() -> None:
    photographs()
