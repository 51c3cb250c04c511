"""Execution of trials: in processes of this machine, or with Ray on the machines of a cluster."""

import multiprocessing
import multiprocessing.process
import os
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, Literal, TypeAlias, TypeVar

from app.core.errors import UsageError
from app.core.system.signals import leave_end_to_parent

Where: TypeAlias = Literal["local", "ray"]
JobT = TypeVar("JobT")
Row: TypeAlias = dict[str, Any]
Run: TypeAlias = Callable[[JobT], Row]
Finished: TypeAlias = tuple[JobT, Row | str]

_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
"""Small linear algebra is slower in threads, the more so beside others', and several share the memory of a GPU."""


def completed_rows(run: Run[JobT], jobs: Sequence[JobT], *, where: Where, processes: int) -> Generator[Finished[JobT]]:
    """Each job with its row as it is finished, in whatever order; with why, in words, where its process was lost.

    With Ray, `processes` are as many as the cluster has processors. Raises UsageError where Ray is not installed.
    """
    share_the_machine()
    yield from _with_ray(run, jobs) if where == "ray" else _local(run, jobs, processes)


def share_the_machine() -> None:
    """Leave room for other processes, unless the environment sets it already. Before JAX looks for devices."""
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)


def _local(run: Run[JobT], jobs: Sequence[JobT], processes: int) -> Generator[Finished[JobT]]:
    left = list(jobs)
    while left:
        # A process that is killed takes its pool with it; alone, one by one, the next kill tells whose fault it was.
        for job in (yield from _run_in_pool(run, left, processes)):
            for again in (yield from _run_in_pool(run, [job], 1)):
                yield again, "its process was killed; if that was for want of memory, use fewer --jobs"


def _run_in_pool(run: Run[JobT], left: list[JobT], processes: int) -> Generator[Finished[JobT], None, list[JobT]]:
    """Take jobs from `left` until it is empty or a process was lost; returns those that were running then.

    Defects of the program are raised when all that were running beside it are finished.
    """
    running, lost, defects = dict[Future[Row], JobT](), list[JobT](), list[BaseException]()
    spawning = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(processes, mp_context=spawning, initializer=_end_with_parent) as pool,
        _ended_if_interrupted(),
    ):
        while running or (left and not (lost or defects)):
            while left and not (lost or defects) and len(running) < processes:
                job = left.pop(0)
                try:
                    running[pool.submit(run, job)] = job
                except BrokenProcessPool:  # A process was lost between two jobs.
                    lost.append(job)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job, error = running.pop(future), future.exception()
                if error is None:
                    yield job, future.result()
                elif isinstance(error, BrokenProcessPool):
                    lost.append(job)
                else:
                    defects.append(error)
    if defects:
        raise defects[0]
    return lost


@contextmanager
def _ended_if_interrupted() -> Generator[None]:
    """Context manager that ends the workers where it is left early: the pool would wait for their jobs, for minutes."""
    try:
        yield
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.kill()
        raise


def _end_with_parent() -> None:
    """End a worker with its parent, and not before it; it would play on without a reader."""
    leave_end_to_parent()
    parent = multiprocessing.process.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


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
