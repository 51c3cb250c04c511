"""Waiting until the arm is at rest."""

from collections.abc import Callable

from app.config import Timing
from app.core.ports import Arm, Clock


async def until_at_rest(arm: Arm, timing: Timing, clock: Clock, *, acts: Callable[[], bool] = lambda: False) -> None:
    """Wait until nothing is moved, nor has been so lately that it is still being looked at.

    `acts`: whether a motion is being made, or what came of it is looked at.
    """
    rested_s = 0.0
    while rested_s <= timing.jog_rest_s + timing.keepalive_s:
        await clock.sleep(timing.keepalive_s)
        moves = acts() or (await arm.state()).mode == "moving"
        rested_s = 0.0 if moves else rested_s + timing.keepalive_s
