"""The checklist before the first motion of a session: checks by the program, and confirmations by a person."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Final, final

import anyio

from app.config import Limits, Site
from app.core.announcer import MessageBus
from app.core.dialogue.checklist import CheckItem, Checklist, ChecklistRequest
from app.core.dialogue.control import Lease
from app.core.geometry.camera import CameraModel
from app.core.messages import ArmState, fresh_id
from app.core.ports import Clock, Rig
from app.flow.perception_stage import Sensing
from app.flow.stop_latch import StopLatch

_PERIOD_S: Final = 0.5
_SIGHT: Final = ("cameras", "calibration", "object")
"""Items that a hand, which goes by a person's eyes, does not need."""
_LATE_S: Final = 2.0
"""News of an arm or a camera that is older is none."""


@final
class Preflight:
    """Gate on motion: if it is `needed`, nothing moves before the checklist is passed; otherwise it is passed at once.

    The operator in control confirms all items for a person: when control changes hands before that, it begins anew.
    """

    def __init__(
        self,
        rig: Rig,
        site: Site,
        sensing: Sensing,
        holding: StopLatch,
        announcer: MessageBus,
        clock: Clock,
        *,
        needed: bool,
    ) -> None:
        self._rig, self._site, self._sensing, self._holding = rig, site, sensing, holding
        self._announcer, self._clock = announcer, clock
        self._asked = _asked(site.limits)
        self._confirmed = dict[str, str]()
        self._said = tuple[CheckItem, ...]()
        self._passed, self._by_hand = anyio.Event(), anyio.Event()
        if not needed:
            self._passed.set()
            self._by_hand.set()

    @property
    def passed(self) -> bool:
        """True if motion is permitted."""
        return self._passed.is_set()

    @property
    def blocked_reason(self) -> str:
        """The reason why nothing moves yet, as text; empty if motion is permitted."""
        if self.passed:
            return ""
        open_items = "; ".join(item.text.rstrip(".") for item in self._said if not item.right)
        return f"Nothing moves before the checklist is complete. Still open: {open_items or 'all of it'}."

    async def wait(self, do: Callable[[str], None]) -> None:
        """Wait until it is passed."""
        if not self.passed:
            do("waiting for the checklist")
            await self._passed.wait()

    async def wait_by_hand(self, do: Callable[[str], None]) -> None:
        """Wait until the tool may be jogged: to calibrate cameras, say, which the rest waits for."""
        if not self._by_hand.is_set():
            do("waiting for the checklist")
            await self._by_hand.wait()

    async def run(self) -> None:
        """Check again and again, until it is passed."""
        while not self.passed:
            await self._look()
            with self._clock.move_on_after(_PERIOD_S):
                await self._passed.wait()

    async def asked(self, request: ChecklistRequest) -> None:
        """Record an operator's confirmation of a checklist item."""
        if self.passed:
            return
        if request.key not in self._asked:
            self._announcer.notice("checklist", f"The checklist has no item {request.key!r}.", request.id)
            return
        self._confirmed[request.key] = request.operator
        await self._look()

    def on_control_transfer(self, lease: Lease) -> None:
        """React to a change of control: confirmations by another operator are void."""
        if any(operator != lease.holder for operator in self._confirmed.values()):
            self._confirmed.clear()
            if self._by_hand.is_set() and not self.passed:
                self._by_hand = anyio.Event()

    async def _look(self) -> None:
        items = (*self._seen(await self._rig.arm.state()), *self._told())
        passed = all(item.right for item in items)
        # Once it was so, it stays so: an arm that a hand moves does not rest.
        by_hand = self._by_hand.is_set() or all(item.right for item in items if item.key not in _SIGHT)
        if items != self._said:
            self._said = items
            now_s = self._clock.now()
            self._announcer.say(
                Checklist(id=fresh_id("checklist"), time_s=now_s, items=items, passed=passed, by_hand=by_hand)
            )
        if by_hand:
            self._by_hand.set()
        if passed and not self.passed:
            self._passed.set()
            self._announcer.notice("checklist", "The checklist is complete; motions may be approved.")

    def _told(self) -> Iterator[CheckItem]:
        for key, text in self._asked.items():
            operator = self._confirmed.get(key, "")
            said = f"confirmed by {operator}" if operator else ""
            yield CheckItem(key=key, text=text, by="operator", right=bool(operator), said=said)

    def _seen(self, arm: ArmState) -> Iterator[CheckItem]:
        """Checks that the program makes by itself."""
        yield _found("arm", "The arm answers, and rests.", self._arm(arm))
        yield _found("place", "The tool is inside the workspace, and in no volume that is kept free.", self._place(arm))
        yield _found("cameras", "Every camera gives pictures.", self._cameras())
        yield _found("calibration", "Every camera's place was calibrated lately.", self._calibrated())
        yield _found("object", "The object is seen.", self._object())
        untried = "press STOP in the bar above, and then Resume" if self._holding.free else "now press Resume"
        tried = "" if self._holding.tried else untried
        yield _found("stop", "STOP works: it was pressed in this session, and lifted.", tried)

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
        volume = limits.trespassed(tip)
        return f"it is in {volume.name!r}: move it out with the arm's own controls" if volume else ""

    def _cameras(self) -> str:
        now_s = self._clock.now()
        frames = {name: channel.value for name, channel in self._sensing.frames.items()}
        late_s = max(_LATE_S, 3 * self._site.timing.camera_period_s)
        silent = [name for name, frame in frames.items() if frame is None or now_s - frame.time_s > late_s]
        return f"nothing new from {', '.join(silent)}; the tab Cell says what is done about it" if silent else ""

    def _calibrated(self) -> str:
        if self._rig.simulated:
            return ""
        today = datetime.now(UTC).date()
        old = [_dated(camera.model) for camera in self._rig.cameras if camera.model.stale(today)]
        return f"{'; '.join(old)}: check or calibrate in the tab Calibrate, and start again" if old else ""

    def _object(self) -> str:
        seen = self._sensing.particles.value
        if seen is None or self._clock.now() - seen.time_s > self._site.timing.object_unseen_s:
            return "look at the masks in the tab Cell"
        return ""


def _asked(limits: Limits) -> dict[str, str]:
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


def _found(key: str, text: str, wrong: str) -> CheckItem:
    return CheckItem(key=key, text=text, by="program", right=not wrong, said=wrong)


def _dated(camera: CameraModel) -> str:
    known = max(camera.calibrated_at, camera.checked_at) or "no known day"
    return f"{camera.name} on {known}" + (f", {camera.doubt}" if camera.doubt else "")
