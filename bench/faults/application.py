"""An application that moves an arm, with injected faults, in a process of its own.

It is to the arm what the real one is: it starts the arm's process, and watches from an event loop what it executes.
"""

import contextlib
import itertools
import os
import sys
import threading
import time
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import Literal, TypeAlias, final

import anyio
import numpy as np
from anyio import to_thread

from app.arm.memory import ArmMemory
from app.arm.process import Controlled, run_arm
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.core.dialogue.jog import Jog
from app.core.errors import DeviceError
from app.core.motion import Motion
from app.core.system.processes import end, process
from bench.approval import approved

Doing: TypeAlias = Literal["motion", "hand"]
"""Activity of the arm when a fault occurs: an approved motion, or jogging."""

_ENDS_M = np.array([[0.45, -0.25, 0.10], [0.45, 0.25, 0.10]])
_POINTS = np.array([[0.7, 0.0, 0.01]], np.float32)
_HAND_PERIOD_S = 0.025
_BLOCKED_S = 1.0


@final
class Application:
    """Moves the tool to and fro for ever. Each of its public methods after `serve` is a fault, by its name."""

    def __init__(self, arm: ProcessArm, site: Site, doing: Doing, done_s: "Synchronized[float]") -> None:
        self._arm, self._site, self._doing, self._done_s = arm, site, doing, done_s
        self._moving: anyio.CancelScope | None = None
        self._hand = self._steady

    async def serve(self, goal_upload: Connection) -> None:
        """Move, and serve commands from outside: the name of a fault, or `again` after one."""
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(self._moves)
            while True:
                name: str = await to_thread.run_sync(goal_upload.recv, abandon_on_cancel=True)
                self._done_s.value = time.monotonic()
                getattr(self, name)()

    def again(self) -> None:
        """Resume jogging; all else goes on by itself once the stop is lifted."""
        self._hand = self._steady

    def block(self) -> None:
        """The event loop hangs."""
        time.sleep(_BLOCKED_S)

    def cancel(self) -> None:
        """Cancel the task that waits for the end of the motion."""
        assert self._moving is not None, "a fault comes while it moves"
        self._moving.cancel()

    def fail(self) -> None:
        """Raise an unexpected error."""
        raise RuntimeError("on purpose")

    def leave(self) -> None:
        """The process ends without a word."""
        os._exit(3)

    def freeze_clock(self) -> None:
        """The clock stands still for a while, so that nothing that sleeps wakes up."""
        frozen_s, running = time.monotonic(), time.monotonic
        time.monotonic = lambda: frozen_s
        timer = threading.Timer(_BLOCKED_S, partial(setattr, time, "monotonic", running))
        timer.daemon = True
        timer.start()

    def stop(self) -> None:
        """Press STOP in a thread."""
        threading.Thread(target=self._arm.stop).start()

    def hush(self) -> None:
        """Stop sending jog commands."""
        self._hand = self._silent

    def babble(self) -> None:
        """Send non-finite jog commands."""
        self._hand = partial(self._arm.jog, Jog(linear=np.full(3, np.nan)))

    async def _moves(self) -> None:
        """Execute, or jog, for ever; after a stop, lift it a little later, as a person would."""
        for end_m in itertools.cycle(_ENDS_M):
            with anyio.CancelScope() as self._moving:  # Cancelled, it goes on only after a while, as a person would.
                try:
                    if self._doing == "motion":
                        speed_m_s = np.array([self._site.limits.speed_m_s])
                        await self._arm.execute(approved(Motion(positions=end_m[None], speeds=speed_m_s), _POINTS))
                    else:
                        await self._jogged()
                except DeviceError:
                    pass
            await anyio.sleep(_BLOCKED_S if self._moving.cancelled_caught else 2 * self._site.timing.arm_period_s)
            if (await self._arm.state()).mode in ("stopped", "fault"):
                await anyio.sleep(_BLOCKED_S)
                with contextlib.suppress(DeviceError):  # It is asked again.
                    await self._arm.reset(asked_s=time.monotonic())

    async def _jogged(self) -> None:
        let_go = threading.Event()
        threading.Thread(target=self._holds, args=(let_go,), daemon=True).start()
        try:
            await self._arm.accept_jogs()
        finally:
            let_go.set()

    def _holds(self, let_go: threading.Event) -> None:
        """Jog in a thread, as a console's: it goes on when the event loop hangs."""
        while not let_go.wait(_HAND_PERIOD_S):
            self._hand()

    def _steady(self) -> bool:
        """Jog to and fro at the largest speed."""
        toward = 1.0 if int(time.monotonic()) % 2 else -1.0
        return self._arm.jog(Jog(linear=np.array([0.0, toward * self._site.limits.speed_m_s, 0.0])))

    def _silent(self) -> bool:
        return False


FAULTS: dict[Doing, tuple[str, ...]] = {
    "motion": ("block", "cancel", "fail", "leave", "freeze_clock", "stop"),
    "hand": ("block", "cancel", "fail", "leave", "freeze_clock", "stop", "hush", "babble"),
}
"""Faults inside the application, by the arm's activity; `bench.faults.inject` adds those from outside a process."""


def application(
    memory: ArmMemory,
    site: Site,
    take: Controlled,
    goal_upload: Connection,
    done_s: "Synchronized[float]",
    doing: Doing,
) -> None:
    """The body of the process; `done_s`: time of its last injected fault.

    It writes nothing of what goes wrong in it: that is on purpose.
    """
    sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - for as long as the process lives
    arm = process("arm", run_arm, memory, site, take, os.getpid())
    arm.daemon = False
    arm.start()
    try:
        while not memory.states.count:
            time.sleep(site.timing.arm_period_s)
        anyio.run(Application(ProcessArm(memory, arm, site), site, doing, done_s).serve, goal_upload)
    finally:
        memory.closing.value = 1
        end([arm])
