"""Gates on motion: stops, which somebody has to lift, and the checklist before the first motion of a session."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Final, final

from app.config import Limits, Site
from app.core.announcer import MessageBus
from app.core.dialogue.checklist import CheckItem, ChecklistRequest
from app.core.errors import DeviceError
from app.core.geometry.camera import CameraModel
from app.core.messages import ArmState, ResumeRequest, fresh_id
from app.core.ports import Arm, Clock, Rig
from app.session.perception_stage import Sensing
from app.session.rules import found_item
from app.session.state import HandRefusal, Inspection, PauseEnd, Resumption
from app.session.store import SessionStore

_PERIOD_S: Final = 0.5
_LATE_S: Final = 2.0
"""News of an arm or a camera that is older is none."""


@final
class StopLatch:
    """Lifts the arm's stops on request, and waits until they are lifted."""

    def __init__(self, arm: Arm, store: SessionStore, announcer: MessageBus, clock: Clock) -> None:
        self._arm, self._store = arm, store
        self._announcer, self._clock = announcer, clock

    async def resume(self, request: ResumeRequest) -> None:
        """Go on, if the arm does."""
        try:
            await self._arm.reset(asked_s=request.time_s)
        except DeviceError as error:
            self._announcer.notice("stop", str(error))
        else:
            self._store.dispatch(Resumption(request.operator, self._clock.now()))

    async def hand_over(self) -> None:
        """Lift the stop of whoever takes over, no later one, and no fault: what follows is made by hand."""
        taken = self._store.state.taken
        if taken is None:
            return
        try:
            arm = await self._arm.state()
            if arm.mode == "fault":
                raise DeviceError(f"The arm cannot be taken over: {arm.reason or 'it is in fault'}.")
            await self._arm.reset(asked_s=taken.time_s)
        except DeviceError as error:
            self._store.dispatch(HandRefusal(str(error)))
        else:
            if self._store.state.taken is taken:
                self._store.dispatch(Resumption(taken.operator, self._clock.now()))

    async def wait(self, do: Callable[[str], None]) -> None:
        """Wait until the operator resumes, if something stopped; for ever, unless the run is unattended."""
        while (state := self._store.state).stopped:
            do("stopped")
            with self._clock.move_on_after(state.patience_s) as waited:
                await self._store.until(lambda state: not state.stopped)
            if waited.cancelled_caught and self._store.state.goes_on:
                await self._go_on()
            elif waited.cancelled_caught and not state.goes_on:
                raise DeviceError(f"The arm was stopped and nobody pressed Resume for {state.patience_s:.0f} s.")

    async def _go_on(self) -> None:
        """Resume as an operator would; once, and not where somebody has pressed STOP since, heard of here or not."""
        self._store.dispatch(PauseEnd())
        request = ResumeRequest(id=fresh_id("resume"), time_s=self._clock.now(), operator="the run")
        if not self._arm.held:  # What is pressed from now on is newer than the request, which does not lift it.
            await self.resume(self._announcer.say(request))


@final
class Preflight:
    """Inspection of the cell for the checklist. Nothing moves before it is passed; see `app.session.rules`."""

    def __init__(self, rig: Rig, site: Site, sensing: Sensing, store: SessionStore, clock: Clock) -> None:
        self._rig, self._site, self._sensing, self._store, self._clock = rig, site, sensing, store, clock

    async def wait(self, do: Callable[[str], None]) -> None:
        """Wait until it is passed."""
        if not self._store.state.passed:
            do("waiting for the checklist")
            await self._store.until(lambda state: state.passed)

    async def wait_by_hand(self, do: Callable[[str], None]) -> None:
        """Wait until the tool may be jogged: to calibrate cameras, say, which the rest waits for."""
        if not self._store.state.by_hand:
            do("waiting for the checklist")
            await self._store.until(lambda state: state.by_hand)

    async def run(self) -> None:
        """Check again and again, until it is passed."""
        while not self._store.state.passed:
            await self._look()
            with self._clock.move_on_after(_PERIOD_S):
                await self._store.until(lambda state: state.passed)

    async def confirm(self, request: ChecklistRequest) -> None:
        """Record an operator's confirmation of a checklist item, and check anew."""
        confirmed = self._store.state.confirmed
        if self._store.dispatch(request).confirmed is not confirmed:  # The rules took it.
            await self._look()

    async def _look(self) -> None:
        self._store.dispatch(Inspection(tuple(self._automatic_checks(await self._rig.arm.state()))))

    def _automatic_checks(self, arm: ArmState) -> Iterator[CheckItem]:
        """Checks that the program makes by itself."""
        yield found_item("arm", "The arm answers, and rests.", self._arm(arm))
        yield found_item(
            "place", "The tool is inside the workspace, and in no volume that is kept free.", self._place(arm)
        )
        yield found_item("cameras", "Every camera gives pictures.", self._cameras())
        yield found_item("calibration", "Every camera's place was calibrated lately.", self._calibration())
        yield found_item("object", "The object is seen.", self._object())

    def _arm(self, arm: ArmState) -> str:
        age_s = self._clock.now() - arm.time_s
        if age_s > _LATE_S:
            return f"its newest state is {age_s:.0f} s old: look at its process and its cable"
        if arm.mode == "idle":
            return ""
        why = f": {arm.reason.rstrip('.')}" if arm.reason else ""
        return f"it is {arm.mode}{why}; Resume lifts a stop or a fault"

    def _place(self, arm: ArmState) -> str:
        limits, tip = self._site.limits, arm.pose[None, :3]
        if not limits.workspace.contains(tip):
            x, y, z = 1e3 * tip[0]
            return f"it is at x {x:.0f} y {y:.0f} z {z:.0f} mm: move it in with the arm's own controls"
        volume = limits.entered_volume(tip)
        return f"it is in {volume.name!r}: move it out with the arm's own controls" if volume else ""

    def _cameras(self) -> str:
        now_s = self._clock.now()
        frames = {name: channel.value for name, channel in self._sensing.frames.items()}
        late_s = max(_LATE_S, 3 * self._site.timing.camera_period_s)
        silent = [name for name, frame in frames.items() if frame is None or now_s - frame.time_s > late_s]
        return f"nothing new from {', '.join(silent)}; the tab Cell says what is done about it" if silent else ""

    def _calibration(self) -> str:
        if self._rig.simulated:
            return ""
        today = datetime.now(UTC).date()
        old = [_date_text(camera.model) for camera in self._rig.cameras if camera.model.stale(today)]
        return f"{'; '.join(old)}: check or calibrate in the tab Calibrate, and start again" if old else ""

    def _object(self) -> str:
        seen = self._sensing.particles.value
        if seen is None or self._clock.now() - seen.time_s > self._site.timing.object_unseen_s:
            return "look at the masks in the tab Cell"
        return ""


def confirmable(limits: Limits) -> dict[str, str]:
    """Items that only a person can confirm, by key."""
    low, high = limits.workspace.low, limits.workspace.high
    box = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
    kept = f"{len(limits.keep_out)} volumes are kept free" if limits.keep_out else "no volume is kept free"
    return {
        "emergency": "The hardware emergency stop is within my reach, and I tried it today.",
        "clear": "Nobody and nothing else is within the arm's reach.",
        "tool": "The gripper holds this task's tool firmly, and the tool frame is at its tip.",
        "limits": f"What is drawn fits the cell: the workspace {box} m, {kept}; {limits.speed_m_s:.2f} m/s at most.",
    }


def _date_text(camera: CameraModel) -> str:
    known = max(camera.calibrated_at, camera.checked_at) or "no known day"
    return f"{camera.name} on {known}" + (f", {camera.doubt}" if camera.doubt else "")
