"""Jobs on the cores of a CPU: a thread that has ended one takes the next, for cores are rarely equal."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


def core_count() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def run_jobs(jobs: int, threads: int, run: Callable[[int, int], None]) -> None:
    """`run(job, slot)` for jobs 0, 1, ...; a slot is one thread's, and there are as many as threads have work."""
    threads = min(threads, jobs)
    waiting = iter(range(jobs))  # Shared: the interpreter lock makes taking the next one atomic.

    def work(slot: int) -> None:
        for job in waiting:
            run(job, slot)

    if threads == 1:
        work(0)
        return
    with ThreadPoolExecutor(threads) as pool:  # Warp's launches release the interpreter lock.
        list(pool.map(work, range(threads)))
