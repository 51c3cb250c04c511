"""The scene that the perception tests look at."""

import pytest

from bench.tube import Tube
from tests.perception.scene import random_tube


@pytest.fixture(scope="package")
def tube() -> Tube:
    return random_tube(0)
