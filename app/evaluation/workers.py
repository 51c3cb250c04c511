"""Where trials run: processes of this machine, or with Ray the machines of a cluster."""

import multiprocessing
import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Literal, TypeAlias, TypeVar

from app.core.errors import UsageError

Where: TypeAlias = Literal["local", "ray"]
JobT = TypeVar("JobT")
Row: TypeAlias = dict[str, Any]
Run: TypeAlias = Callable[[JobT], Row]
Finished: TypeAlias = tuple[JobT, Row | str]

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
"""Small linear algebra is slower in threads, and the more so beside others'."""


def finished(run: Run[JobT], jobs: Sequence[JobT], *, where: Where, processes: int) -> Generator[Finished[JobT]]:
    """Each job with its row as it is finished, in whatever order; with why, in words, where its process was lost.

    With Ray, `processes` are as many as the cluster has processors. Raises UsageError where Ray is not installed.
    """
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    yield from _with_ray(run, jobs) if where == "ray" else _local(run, jobs, processes)


def _local(run: Run[JobT], jobs: Sequence[JobT], processes: int) -> Generator[Finished[JobT]]:
    left = list(jobs)
    while left:
        # A process that is killed takes its pool with it; alone, one by one, the next kill tells whose fault it was.
        for job in (yield from _pooled(run, left, processes)):
            for again in (yield from _pooled(run, [job], 1)):
                yield again, "its process was killed; if that was for want of memory, use fewer --jobs"


def _pooled(run: Run[JobT], left: list[JobT], processes: int) -> Generator[Finished[JobT], None, list[JobT]]:
    """Take jobs from `left` until it is empty or a process was lost; returns those that were running then."""
    running, lost = dict[Future[Row], JobT](), list[JobT]()
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        while running or (left and not lost):
            while left and not lost and len(running) < processes:
                job = left.pop(0)
                running[pool.submit(run, job)] = job
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job, outcome = running.pop(future), _outcome(future)
                if outcome is None:
                    lost.append(job)
                else:
                    yield job, outcome
    return lost


def _outcome(future: Future[Row]) -> Row | None:
    """The row; None where the process was lost. Defects of the program are raised."""
    try:
        return future.result()
    except BrokenProcessPool:
        return None


def _with_ray(run: Run[JobT], jobs: Sequence[JobT]) -> Generator[Finished[JobT]]:
    try:
        import ray  # pyright: ignore[reportMissingImports] - an extra
    except ImportError:
        raise UsageError('--workers ray needs Ray; install it with `.venv/bin/pip install -e ".[ray]"`.') from None
    ray.init(ignore_reinit_error=True, log_to_driver=False)
    remote: Any = ray.remote(max_retries=1)(run)
    pending = {remote.remote(job): job for job in jobs}
    while pending:
        done, _ = ray.wait(list(pending), num_returns=1)
        for reference in done:
            job = pending.pop(reference)
            try:
                yield job, ray.get(reference)
            except ray.exceptions.WorkerCrashedError as error:
                yield job, f"its process was lost: {error}"
