"""Memory estimate of a rollout, made before anything is allocated."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

from app.core.errors import MemoryPlanError
from app.sim.constants import BLOCK_NODES
from app.sim.mpm.simd_layout import QUADS
from app.sim.runtime.schedule import Schedule

_QUAD = 16
_FORTH, _BACK = 3, 7
"""Vec4 a node: mass, touch and aim; on the way back also velocity and three cotangents."""

Bytes: TypeAlias = Callable[[int], int]
"""Bytes as a function of the number of candidates."""


def bytes_of(schedule: Schedule, *, particles: int, blocks: int, rows: int, backwards: bool) -> Bytes:
    """Memory of a rollout with `rows` states of history: history, grids, and the states it is given and returns.

    It excludes memory of the caller, such as the histories of other rollouts in one gradient.
    """
    node = _QUAD * (_BACK if backwards else _FORTH)
    grid, blocks_of_a_list = blocks * (int(BLOCK_NODES) * node + 4), 8 * blocks
    states = rows + (4 if backwards else 2)

    def count(candidates: int) -> int:
        grids = schedule.slots(candidates, backwards=backwards) * grid + schedule.lists(candidates) * blocks_of_a_list
        return grids + candidates * states * QUADS * _QUAD * particles

    return count


def require(needed: Bytes, candidates: int, device: Any) -> None:
    """Raises MemoryPlanError if the candidates do not fit, with the largest number that would."""
    free = available(device)
    if needed(candidates) > free:
        raise MemoryPlanError(
            f"{candidates} candidates need {_mib(needed(candidates))}, and {_mib(free)} are free on {device}; "
            f"{largest(needed, free, candidates)} would fit. Simulate fewer at a time, fewer substeps or particles, or "
            "divide them among devices (app.sim.runtime.shard)."
        )


def largest(needed: Bytes, free: int, limit: int) -> int:
    """The largest number of candidates up to `limit` that takes at most `free` bytes; 0 if none does."""
    fits, too_many = 0, limit + 1
    while too_many - fits > 1:
        middle = (fits + too_many) // 2
        fits, too_many = (middle, too_many) if needed(middle) <= free else (fits, middle)
    return fits


def available(device: Any) -> int:
    """Free bytes of a device; for a CPU, those of the system without swapping."""
    stats = device.memory_stats()
    if stats:
        return int(stats["bytes_limit"]) - int(stats["bytes_in_use"])
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    raise MemoryPlanError("/proc/meminfo does not say how much memory is free (MemAvailable).")


def _mib(count: int) -> str:
    return f"{count / 2**20:,.0f} MiB"
