"""Learned policies that guide the planner, as named on the command line."""

from dataclasses import replace
from pathlib import Path

from app.planner.method import Method
from app.tasks import load


def with_policy(method: Method, policy: Path | None, task: str) -> Method:
    """The method, guided by the learned policy if one is named.

    Raises UsageError and RecordingError if it is none of that task, or the method does not use one.
    """
    if policy is None:
        return method
    from app.jobs.teaching import load_learned  # Loads JAX, which only those pay for who need it.

    return replace(method, policy=load_learned(policy, load(task)))
