"""The arm's own process: a control loop with gate and watchdog, for any kind of arm."""

import os
import time
from collections.abc import Callable
from typing import TypeAlias, final

import numpy as np

from app.arm.control import Control
from app.arm.gate import begin
from app.arm.memory import MODES, TEXT_BYTES, ArmMemory, jog_of, motion_of
from app.config import Site
from app.core.errors import MotionRefused
from app.core.system.gc_control import spared_collection
from app.core.system.processes import ask_for_real_time

Controlled: TypeAlias = Callable[[Site], Control]
"""Factory that connects to an arm; called in its process. Raises DeviceError where there is none."""

_LATEST_TICK_PERIODS = 3.0
"""Longest tick in periods: after a later one the arm moves no further than this, and lags."""
_USUALLY = "A computer that is too busy is the usual cause; end what else it does."
_REST_S = 1.0
"""Time for an arm whose application is gone to come to rest."""


def run_arm(memory: ArmMemory, site: Site, take: Controlled, parent: int) -> None:
    """Body of the process: tick every `site.timing.arm_period_s` until closed or until `parent` is gone.

    It ends once the arm is at rest. Raises DeviceError where `take` finds no arm.
    """
    ask_for_real_time()
    control = take(site)
    loop = ControlLoop(memory, site, control)
    try:
        with spared_collection():
            loop.run(lambda: not memory.closing.value and os.getppid() == parent)
            control.stop("The application has ended.")
            until_s = time.monotonic() + _REST_S
            loop.run(lambda: control.mode in ("moving", "stopping") and time.monotonic() < until_s)
    finally:
        control.close()


@final
class ControlLoop:
    """The control loop of an arm between two ticks. `tick` has no clock."""

    def __init__(self, memory: ArmMemory, site: Site, control: Control) -> None:
        self._memory, self._site, self._timing = memory, site, site.timing
        self._control = control
        self._heard = self._begun = self._stop_ns = self._reset_ns = self._keepalives = 0
        self._jogs = 0
        self._heard_s = self._jogged_s = 0.0

    def run(self, on: Callable[[], bool]) -> None:
        """Tick once a period while `on()` is true."""
        period = self._timing.arm_period_s
        last = time.monotonic()
        due = last + period
        while on():
            time.sleep(max(0.0, due - time.monotonic()))
            now = time.monotonic()
            self.tick(now, now - last)
            due, last = max(due + period, now), now

    def tick(self, now_s: float, elapsed_s: float) -> None:
        """Read commands, move, report.

        Commands that are read late came as early as they may have, so that an arm whose process did not run for a while
        is not kept going by what was said at its beginning.
        """
        since_s = min(now_s, now_s - elapsed_s + self._timing.arm_period_s)
        self._hear_stop_and_reset()
        self._hear_watcher(since_s, now_s)
        self._hear_motion(since_s)
        self._hear_jogs(since_s, now_s)
        self._watch(now_s)
        self._wake(elapsed_s)
        self._feel()
        self._control.advance(min(elapsed_s, _LATEST_TICK_PERIODS * self._timing.arm_period_s))
        self._hear_refusal()
        self._report(now_s, elapsed_s)

    def _hear_stop_and_reset(self) -> None:
        """Obey every stop, however soon it was lifted: a reset waits for the next tick, and for rest."""
        stop_ns, reset_ns = self._memory.stop_ns.value, self._memory.reset_ns.value
        if stop_ns != self._stop_ns:
            self._stop_ns = stop_ns
            self._control.stop("STOP was pressed.")
        elif reset_ns >= stop_ns and reset_ns > self._reset_ns and self._control.mode != "stopping":
            self._reset_ns = reset_ns
            self._control.reset()

    def _hear_motion(self, since_s: float) -> None:
        """Begin the newest motion posted since the last one, which came after `since_s`, or report its refusal."""
        if self._memory.motions.count == self._heard:
            return
        self._heard, request = self._memory.motions.count, self._memory.motions.newest()
        try:
            begin(self._control, motion_of(request), bytes(request["digest"]).decode(), self._site)
            self._begun, self._heard_s = self._heard, max(self._heard_s, since_s)
        except MotionRefused as refusal:
            self._refuse(self._heard, refusal)

    def _hear_refusal(self) -> None:
        """Report a motion that the arm refused after it had begun."""
        if (refusal := self._control.refusal()) is not None:
            self._refuse(self._begun, refusal)

    def _refuse(self, motion: int, refusal: MotionRefused) -> None:
        code, reason = refusal.code.encode(), refusal.sentence.encode()[:TEXT_BYTES]
        self._memory.refusals.append(motion=motion, code=code, reason=reason)

    def _hear_jogs(self, since_s: float, now_s: float) -> None:
        """Follow the newest jog, which came after `since_s`.

        Brake where none has come within the watchdog's time, or none is accepted.
        """
        memory, control = self._memory, self._control
        new, self._jogs = memory.jogs.count != self._jogs, memory.jogs.count
        heeds = memory.accepts_jog.value and now_s - self._heard_s <= self._timing.watchdog_s
        if new and heeds and control.jog(jog_of(memory.jogs.newest())):
            self._jogged_s = since_s
        elif not heeds or now_s - self._jogged_s > self._timing.watchdog_s:
            control.decelerate()

    def _hear_watcher(self, since_s: float, now_s: float) -> None:
        """Note keep-alives by this clock: a sender's wrong stamps keep no arm going.

        The first came after `since_s`, each other a period after the one before: the last one as late as that, or now.
        """
        keepalives = self._memory.keepalives.value
        if keepalives != self._keepalives:
            further_s = (keepalives - self._keepalives - 1) * self._timing.keepalive_s
            self._keepalives, self._heard_s = keepalives, min(now_s, since_s + further_s)

    def _watch(self, now_s: float) -> None:
        """Stop a motion without a keep-alive within the watchdog's time; jogs are not accepted then."""
        silence_s = now_s - self._heard_s
        followed = self._control.mode == "moving" and not self._control.jogging
        if followed and silence_s > self._timing.watchdog_s:
            self._control.stop(
                f"Watchdog: nothing was heard from the application for {silence_s * 1e3:.0f} ms. {_USUALLY}"
            )

    def _wake(self, elapsed_s: float) -> None:
        """Stop where this process itself has not run for longer than the watchdog's time: the arm was unsupervised."""
        if elapsed_s > self._timing.watchdog_s and self._control.mode == "moving":
            self._control.stop(f"The arm's own process did not run for {elapsed_s * 1e3:.0f} ms. {_USUALLY}")

    def _feel(self) -> None:
        """Stop where the force on the tool exceeds its limit; NaN, from an arm that measures none, does not."""
        force_n, most_n = float(np.linalg.norm(self._control.force)), self._site.limits.force_n
        if force_n > most_n and self._control.mode == "moving":
            self._control.stop(f"The tool met {force_n:.0f} N, more than {most_n:g} N; look at what it touches.")

    def _report(self, now_s: float, elapsed_s: float) -> None:
        control = self._control
        self._memory.states.append(
            time_s=now_s,
            period_s=elapsed_s,
            commanded=control.commanded,
            measured=control.measured,
            velocity=control.velocity,
            joints=control.joints,
            force=control.force,
            mode=MODES.index(control.mode),
            motion=self._begun,
            reset_ns=self._reset_ns,
            reason=control.reason.encode()[:TEXT_BYTES],
        )
