"""Threads that drive an arm, so that its controller never blocks: feedback, keep-alive, commands, and stop.

Each thread makes its own calls; none holds a lock while it waits for the arm. The session is kept alive only while
`pulse` is called: after a loop hangs, the arm's own timeout stops it.
"""

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.config import Site
from app.core.errors import DeviceError
from app.rig.kinova.api.errors import LinkLost, NoAnswer, Refused
from app.rig.kinova.arm_configuration_check import Holds, OwnLimits, check
from app.rig.kinova.command_handle import CommandHandle, Preempted, execute_path
from app.rig.kinova.feedback_conversion import ArmFeedback, feedback_of
from app.rig.kinova.grip import Grip
from app.rig.kinova.kortex import Kortex
from app.rig.kinova.trajectory_segments import TrajectorySegment, in_base

FEEDBACK_S, ALIVE_S, COMMAND_S = 0.010, 0.025, 0.025
"""Periods [s] of feedback, of keep-alive, and of twists: the arm executes 40 commands a second."""
PULSES, TWIST_S = 5, 0.150
"""Keep-alive periods without a pulse after which the loop counts as hanging, and the age at which a twist ends [s]."""
_WATCHERS = 4
"""Threads that ask for feedback in turn: a lost datagram delays one of them."""
_SHOWS_S, _THINKS_S = 0.05, 5.0
"""Longest delay of a fault in the feedback, and longest planning time of an arm [s] (ros_kortex #258: 2 s)."""
_OURS = "dipac "
"""Prefix of the names of the protection zones made here."""
BACK_OFF_S = (0.0, 0.2, 0.5, 1.0, 2.0, 5.0)
_STOP_S, _STOPS, _FIRST_S, _JOIN_S, _CLEAR_S = 0.3, 3, 3.0, 3.0, 3.0
_Velocity: TypeAlias = tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]
_Body: TypeAlias = Callable[[int, CommandHandle], None]


@final
class Driver:
    """Driver of one arm. Only `open` and `close` block.

    `trouble`: reason why the arm is unreachable; `refused`: reason why it did not follow the last command; `feedback`:
    its last measurement; `losses`: lost connections so far.
    """

    def __init__(self, kortex: Kortex, site: Site, holds: Holds) -> None:
        self._kortex, self._site, self._holds = kortex, site, holds
        self._own_limits, self._grip = OwnLimits(kortex), Grip(kortex, site.limits.gripper_ma)
        self._seen: ArmFeedback | None = None
        self._over, self._stop, self._work = threading.Event(), threading.Event(), threading.Condition()
        self._handles = deque[tuple[int, CommandHandle, _Body]]()
        self._twist: _Velocity | None = None
        self._twist_s = 0.0
        self._stops = self._pulses = self._asked = self._answered = 0
        self._asking = threading.Lock()
        self._threads: list[threading.Thread] = []
        self.trouble = self.refused = self._defied = ""
        self._denied: tuple[float, str] | None = None
        self.losses = 0

    def open(self) -> None:
        """Connect, set the arm up, wait for its first feedback, and start the threads. Raises DeviceError."""
        try:
            self._kortex.open()
            self._set_up()
        except DeviceError:
            self._let_go()
            raise
        bodies = (*[self._watch] * _WATCHERS, self._live, self._command, self._halt, self._ease)
        self._threads = [threading.Thread(target=body, name=f"dipac{body.__name__}", daemon=True) for body in bodies]
        for thread in self._threads:
            thread.start()
        end = time.monotonic() + _FIRST_S
        while self._seen is None:
            if time.monotonic() > end:
                self.close()
                raise DeviceError("The arm says nothing over UDP; open port 10001 on the way to it, then try again.")
            time.sleep(FEEDBACK_S)

    def close(self) -> None:
        """Stop the arm, end the threads and the connection."""
        if not self._over.is_set() and not self.trouble:
            self.stop()
            with contextlib.suppress(LinkLost, Refused):
                self._kortex.stop(timeout_s=_STOP_S)
            self._wait_for_stop()
        self._over.set()
        with self._work:
            self._work.notify_all()
        self._stop.set()
        self._grip.end()
        for thread in self._threads:
            thread.join(_JOIN_S)
        self._let_go()

    @property
    def feedback(self) -> ArmFeedback:
        """The arm as last measured. Only after `open`."""
        assert self._seen is not None
        return self._seen

    def pulse(self) -> None:
        """Heartbeat of the controller: keeps the session alive for a little longer."""
        self._pulses += 1

    def go(self, stretches: tuple[TrajectorySegment, ...]) -> CommandHandle:
        """Have the arm validate all segments, then execute them in order; they are in the table's frame."""
        told = tuple(in_base(stretch, self._site.table) for stretch in stretches)

        def body(number: int, handle: CommandHandle) -> None:
            execute_path(handle, self._kortex, self._grip.close, told, self._current(number), lambda: self.feedback)

        return self._send(body)

    def clear(self) -> CommandHandle:
        """Have the arm leave its fault."""
        return self._send(lambda _number, _handle: self._clear())

    def grip(self, closed: float) -> CommandHandle:
        """Move the fingers: 0 open to 1 closed. The tool goes on with its motion."""
        return self._send(lambda _number, _handle: self._grip.close(closed), ends_twist=False)

    def twist(self, linear: Float64[np.ndarray, "3"], angular: Float64[np.ndarray, "3"]) -> None:
        """Move at this velocity [m/s, rad/s] until another or `stop`; ended where it is not repeated soon.

        Along and about the table's axes.
        """
        told = self._site.table.vector_in_base(linear), self._site.table.vector_in_base(angular)
        with self._work:
            self._twist, self._twist_s = told, time.monotonic()
            self._work.notify_all()

    def stop(self) -> None:
        """Stop the arm and drop its pending commands; it does not queue behind any of them."""
        with self._work:
            self._stops += 1
            self._twist, self.refused = None, ""
            dropped, self._handles = self._handles, deque()
        for _, handle, _ in dropped:
            handle.end("It was stopped before it began.")
        self._stop.set()

    def _send(self, body: _Body, *, ends_twist: bool = True) -> CommandHandle:
        handle = CommandHandle()
        with self._work:
            self._twist = None if ends_twist else self._twist
            self._handles.append((self._stops, handle, body))
            self._work.notify_all()
        return handle

    def _current(self, number: int) -> Callable[[], None]:
        """A check that raises Superseded once a stop has come since, or the connection is gone."""

        def check() -> None:
            if self._stops != number or self._over.is_set() or self.trouble:
                raise Preempted

        return check

    def _set_up(self) -> None:
        """Configure the arm for this site. Raises DeviceError."""
        limits, table = self._site.limits, self._site.table
        if (joints := self._kortex.joint_count()) != 7:
            raise DeviceError(f"The arm has {joints} joints; only a Gen3 of seven is known here.")
        # An arm in fault may refuse; clearing the fault repeats the request.
        with contextlib.suppress(Refused):
            self._kortex.servo()
        check(self._kortex, self._holds)
        self._own_limits.set(limits)
        # Zones outlive sessions: those of an earlier site are not this one's.
        for name, number in self._kortex.forbidden().items():
            if name.startswith(_OURS):
                self._kortex.allow(number)
        for volume in limits.keep_out:
            low, high = np.asarray(volume.low), np.asarray(volume.high)
            T = table.base_from_table
            middle = T[:3, :3] @ ((low + high) / 2) + T[:3, 3]
            self._kortex.forbid(f"{_OURS}{volume.name}", [*middle], [*(high - low)], T[:3, :3])

    def _let_go(self) -> None:
        """Restore the arm's limits and end the connection."""
        self._own_limits.restore()
        self._kortex.close()

    def _watch(self) -> None:
        """Poll feedback; the answer to the latest request counts."""
        while not self._over.wait(_WATCHERS * FEEDBACK_S):
            if self.trouble:
                continue
            with self._asking:
                self._asked += 1
                number = self._asked
            try:
                said = self._kortex.feedback()
            except (LinkLost, Refused):
                continue  # One datagram may be lost; the connection reports the loss of many, see `_live`.
            found = feedback_of(said, time.monotonic(), self._site.limits.opening_m, self._site.table)
            with self._asking:
                if found is not None and number > self._answered:
                    self._seen, self._answered = found, number
                    self._grip.look(found)
                    self._judge(found)

    def _live(self) -> None:
        """Keep the session alive while the controller pulses, stop where it does not, reconnect a lost connection."""
        heard = missed = 0
        while not self._over.wait(ALIVE_S):
            # Counted, not timed: where this whole process was late, the arm notices by its own clock.
            missed = missed + 1 if self._pulses == heard else 0
            heard = self._pulses
            if self._defied:
                continue  # The arm stops the motions of a silent session.
            try:
                if self._kortex.loss_reason:
                    raise LinkLost(self._kortex.loss_reason)
                if missed < PULSES:
                    self._kortex.keep_alive()
                elif missed == PULSES:
                    self._stop.set()  # A little sooner than the arm would by itself.
            except LinkLost as error:
                self._reconnect(str(error))

    def _reconnect(self, reason: str) -> None:
        """Reconnect with growing delays until it succeeds. The arm has stopped by itself meanwhile."""
        self.trouble = f"The connection to the arm is lost, and is made again; the arm stops by itself. {reason}"
        self.losses += 1
        self.stop()
        waits = iter(BACK_OFF_S)
        wait_s = next(waits)
        while not self._over.wait(wait_s):
            wait_s = next(waits, BACK_OFF_S[-1])
            try:
                self._kortex.open()
                # First of all: a dead session sends no keep-alive, and the arm waits for it for a while.
                self._say_stop()
                self._set_up()
            except DeviceError as error:
                self.trouble = f"The connection to the arm is lost, and is made again. {error}"
            else:
                self.trouble = self._defied
                if self._defied:
                    self._kortex.cut()
                return

    def _command(self) -> None:
        """Execute commands in order; twists at the pace of the arm."""
        moving = False
        while not self._over.is_set():
            with self._work:
                self._work.wait_for(self._has_work, COMMAND_S)
                handle = self._handles.popleft() if self._handles else None
                number, twist, age_s = self._stops, self._twist, time.monotonic() - self._twist_s
                if age_s > TWIST_S:
                    self._twist = twist = None
            if handle is not None:
                begun, what, body = handle
                self._run(begun, what, body)
            elif twist is not None:
                moving = True
                self._push(number, twist)
                self._over.wait(COMMAND_S)
            elif moving:
                # The command has expired, and the arm would continue it for ever.
                moving = False
                self._stop.set()

    def _has_work(self) -> bool:
        """True where the command thread has work, or must end."""
        return bool(self._handles) or self._twist is not None or self._over.is_set()

    def _push(self, number: int, twist: _Velocity) -> None:
        """Send a twist; an unanswered one may have been received all the same."""
        try:
            self._kortex.twist(*twist)
        except LinkLost:
            pass  # The connection reports it, see `_live`.
        except Refused as error:
            with self._work:
                self.refused = str(error) if self._stops == number else ""
        if self._stops != number:
            self._stop.set()  # A stop came while it was sent, and may have been heard before it.

    def _run(self, number: int, handle: CommandHandle, body: _Body) -> None:
        problem = ""
        try:
            body(number, handle)
        except Preempted:
            problem = "It was stopped."
        except DeviceError as error:
            problem = str(error)
        if self._stops != number or (problem and handle.refusal is None):
            self._stop.set()  # A command begun before the stop may have been received after it.
        handle.end(problem)

    def _clear(self) -> None:
        """Clear faults and verify. Raises DeviceError with those that remain."""
        self._kortex.clear_faults()
        self._kortex.servo()
        end = time.monotonic() + _CLEAR_S
        while time.monotonic() < end:
            asked_s = time.monotonic()
            # The feedback has to agree too, or it is from before.
            while self._kortex.ready() and time.monotonic() < end:
                if self.feedback.time_s > asked_s and not self.feedback.faults:
                    return
                self._over.wait(FEEDBACK_S)
            self._over.wait(0.05)
        if left := " ".join(self.feedback.faults):
            raise DeviceError(f"The arm is still in fault: {left} Remove the cause, then press Resume again.")
        raise DeviceError("The arm is not ready yet; wait until it is at rest, then press Resume again.")

    def _halt(self) -> None:
        """Send Stop whenever it is requested, until the arm has received it."""
        while not self._over.is_set():
            self._stop.wait()
            self._stop.clear()
            for _ in range(_STOPS):
                try:
                    self._say_stop()
                except NoAnswer:
                    continue
                except LinkLost:
                    pass  # It stops by itself.
                break

    def _say_stop(self) -> None:
        """Send Stop once. The reaction to a refusal depends on later feedback (`_judge`). Raises LinkLost."""
        try:
            self._kortex.stop(timeout_s=_STOP_S)
        except Refused as error:
            # The first of several counts: a held key repeats Stop before any of them could be judged.
            self._denied = self._denied or (time.monotonic(), str(error))
        else:
            self._denied = None

    def _judge(self, found: ArmFeedback) -> None:
        """Cut the connection to an arm that refused to stop and moves: it stops for want of a session.

        One in fault stops by itself, and one at rest for longer than any planning time has no motion pending.
        """
        denied = self._denied
        if denied is None or found.time_s < denied[0] + _SHOWS_S:
            return
        if found.faults or found.time_s > denied[0] + _THINKS_S:
            self._denied = None
        elif not found.still:
            self.trouble = self._defied = (
                f"The arm refuses to stop, and is left to its own time-out: {denied[1]} Use its hardware stop, find "
                "out who else commands it, and start this program again."
            )
            self._kortex.cut()

    def _ease(self) -> None:
        """Relax fingers that press too hard."""
        self._grip.watch(self._over)

    def _wait_for_stop(self) -> None:
        end = time.monotonic() + 1.0
        while self._seen is not None and not self._seen.still and time.monotonic() < end:
            time.sleep(FEEDBACK_S)
