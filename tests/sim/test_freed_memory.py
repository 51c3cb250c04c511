"""Freed memory stays with a process that simulates."""

import resource
import sys

import numpy as np
import pytest

from app.sim.runtime.freed_memory import keep_freed_memory
from app.sim.runtime.rollout import make_rollout
from tests.sim.scenes import SCENE

ARRAY_BYTES, REPEATS = 48 << 20, 10


def faults_of_arrays() -> int:
    """Pages that were mapped as large arrays were made, filled and freed in turn."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(REPEATS):
        np.empty(ARRAY_BYTES, np.uint8).fill(1)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif(sys.platform != "linux", reason="mallopt is glibc's")
def test_a_process_that_simulates_maps_large_arrays_once():
    make_rollout(SCENE, particle_count=8)
    if not keep_freed_memory():
        pytest.skip("this C library does not keep freed memory")
    faults_of_arrays()
    assert faults_of_arrays() < ARRAY_BYTES // resource.getpagesize()
