"""Which learned policy guides the planner, where one is named."""

from dataclasses import replace
from pathlib import Path

from app.planner.method import Method
from app.tasks import load


def guided(method: Method, policy: Path | None, task: str) -> Method:
    """By the learned policy, where one is named.

    Raises UsageError and RecordingError where it is none of that task, or the method has no use for it.
    """
    if policy is None:
        return method
    from app.tasks.teaching import learned  # Loads JAX, which only those pay for who need it.

    return replace(method, policy=learned(policy, load(task)))
