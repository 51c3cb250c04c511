"""The scene that the perception tests look at."""

import pytest

from tests.perception.scene import Tube, random_tube


@pytest.fixture(scope="package")
def tube() -> Tube:
    return random_tube(0)
