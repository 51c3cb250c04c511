"""Laws of compiled programs with Warp calls: another process finds them."""

import os
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import pytest
import warp as wp

from app.sim.runtime.calls import WarpCall, make_warp_call

RODS = """
import sys
from dataclasses import replace

import jax
import jax.numpy as jnp

from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from tests.sim.pushed_ropes import SCENE, curve, lying

finger = jnp.tile(jnp.asarray([0.0, 0.0, 0.3]), (1, 5, 1))
for length_m in map(float, sys.argv[1:]):
    scene = replace(SCENE, length_m=length_m)
    simulate = make_rod_rollout(scene)
    start = lying(curve(1.0, scene))
    jax.block_until_ready(jax.grad(lambda x: simulate(RodPhysics.nominal(scene, 1), start, x).nodes.sum())(finger))
"""


def kept_after(folder: Path, lengths_m: list[str]) -> set[str]:
    """Programs on disk after a process made simulators of ropes of these lengths, in that order."""
    known = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(folder), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    known |= {"JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1"}
    subprocess.run([sys.executable, "-c", RODS, *lengths_m], env=known, check=True, timeout=300)
    return {file.name for file in folder.glob("*-cache")}


@pytest.mark.serial
def test_a_process_finds_what_another_one_compiled_in_another_order(tmp_path: Path):
    first = kept_after(tmp_path, ["0.40", "0.44"])
    assert first
    assert kept_after(tmp_path, ["0.44", "0.40"]) == first


def filler(value: float) -> WarpCall:
    """The call that fills an array; its name cannot tell the value."""

    def fill(given: wp.array(dtype=wp.float32), out: wp.array(dtype=wp.float32)) -> None:  # pyright: ignore[reportInvalidTypeForm]
        del given
        out.fill_(value)

    return make_warp_call(fill, lambda: value, num_outputs=1)


def test_calls_of_one_name_that_are_made_for_different_things_stay_apart():
    given = jnp.zeros(3)
    filled = [filler(value)(given, output_dims={"out": (3,)})[0].tolist() for value in (1.0, 2.0)]
    assert filled == [[1.0] * 3, [2.0] * 3]


def test_a_call_made_again_for_an_equal_thing_is_the_same():
    def nothing(given: wp.array(dtype=wp.float32)) -> None:  # pyright: ignore[reportInvalidTypeForm]
        del given

    assert make_warp_call(nothing, (0.1, "x"), num_outputs=1) is make_warp_call(nothing, (0.1, "x"), num_outputs=1)
    assert make_warp_call(nothing, (0.2, "x"), num_outputs=1) is not make_warp_call(nothing, (0.1, "x"), num_outputs=1)
