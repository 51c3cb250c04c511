"""Jobs are finished in processes of their own, and a process that is killed costs its own job alone."""

import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import psutil
import pytest

from app.core.errors import UsageError
from app.evaluation.workers import completed_rows

pytestmark = pytest.mark.serial

PATIENCE_S = 60.0


def squared(number: int) -> dict[str, Any]:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": number**2}


def once_killed(folder: Path) -> dict[str, Any]:
    mark = folder / "tried"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"done": True}


@pytest.mark.parametrize("processes", [1, 2])
def test_each_job_is_finished_once_and_the_one_that_kills_its_process_says_so(processes: int) -> None:
    outcomes = dict(completed_rows(squared, range(6), where="local", processes=processes))
    assert {job: row for job, row in outcomes.items() if job != 3} == {n: {"square": n**2} for n in (0, 1, 2, 4, 5)}
    assert isinstance(outcomes[3], str)
    assert "killed" in outcomes[3]


def test_a_job_whose_process_was_killed_from_outside_is_done_again(tmp_path: Path) -> None:
    assert list(completed_rows(once_killed, [tmp_path], where="local", processes=2)) == [(tmp_path, {"done": True})]


def defective(number: int) -> dict[str, Any]:
    if number == 0:
        raise ArithmeticError("a defect")
    time.sleep(1.0)
    return {"number": number}


def test_a_defect_is_raised_after_what_ran_beside_it_is_finished() -> None:
    seen = list[int]()
    with pytest.raises(ArithmeticError, match="a defect"):
        seen.extend(job for job, _ in completed_rows(defective, range(4), where="local", processes=2))
    assert seen == [1]


def ticking(folder: Path) -> dict[str, Any]:
    while True:
        (folder / str(os.getpid())).touch()
        time.sleep(0.05)


@pytest.mark.serial
def test_workers_end_with_their_parent_even_if_it_is_killed(tmp_path: Path) -> None:
    code = "import sys; from pathlib import Path; from tests.evaluation.test_workers import ticking\n"
    code += "from app.evaluation.workers import completed_rows\n"
    code += "if __name__ == '__main__': list(completed_rows(ticking, [Path(sys.argv[1])], where='local', processes=1))"
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)])
    given_up_s = time.monotonic() + PATIENCE_S
    while not any(tmp_path.iterdir()):
        assert process.poll() is None
        assert time.monotonic() < given_up_s
        time.sleep(0.05)
    process.kill()
    process.wait()
    (worker,) = (int(mark.name) for mark in tmp_path.iterdir())
    while psutil.pid_exists(worker) and psutil.Process(worker).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < given_up_s
        time.sleep(0.05)


@pytest.mark.skipif(find_spec("ray") is not None, reason="Ray is installed")
def test_without_ray_the_error_says_how_to_install_it() -> None:
    with pytest.raises(UsageError, match=r'-e "\.\[ray\]"'):
        list(completed_rows(squared, [1], where="ray", processes=1))


def quick_or_endless(number: int) -> dict[str, Any]:
    if number:
        time.sleep(600.0)
    return {"number": number}


def test_leaving_early_ends_the_jobs_that_are_running() -> None:
    rows = completed_rows(quick_or_endless, range(4), where="local", processes=2)
    assert next(rows) == (0, {"number": 0})
    began_s = time.monotonic()
    rows.close()
    assert time.monotonic() - began_s < PATIENCE_S
