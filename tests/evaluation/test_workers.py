"""Jobs are finished in processes of their own, and a process that is killed costs its own job alone."""

import os
import signal
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from app.core.errors import UsageError
from app.evaluation.workers import finished


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
    outcomes = dict(finished(squared, range(6), where="local", processes=processes))
    assert {job: row for job, row in outcomes.items() if job != 3} == {n: {"square": n**2} for n in (0, 1, 2, 4, 5)}
    assert isinstance(outcomes[3], str)
    assert "killed" in outcomes[3]


def test_a_job_whose_process_was_killed_from_outside_is_done_again(tmp_path: Path) -> None:
    assert list(finished(once_killed, [tmp_path], where="local", processes=2)) == [(tmp_path, {"done": True})]


@pytest.mark.skipif(find_spec("ray") is not None, reason="Ray is installed")
def test_without_ray_the_error_says_how_to_install_it() -> None:
    with pytest.raises(UsageError, match=r'-e "\.\[ray\]"'):
        list(finished(squared, [1], where="ray", processes=1))
