"""A rig inside this process: the simulated arm's control loop, and cameras that show photographs.

The arm is ticked by whoever executes. The photographs show the rope where somebody has put it, and the arm at its home;
the strokes that it is asked for never come near the rope.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Literal, TypeAlias, final

import anyio
import numpy as np

from app.arm.approvals import UsedApprovals
from app.arm.gate import begin
from app.config import Site
from app.core.dialogue.approval import Approved
from app.core.dialogue.jog import Jog
from app.core.errors import DeviceError, MotionRefused
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.camera import CameraModel
from app.core.messages import ArmState, Executed, Frame, MessageId, fresh_id
from app.core.motion import pointing_down
from app.core.rejection_codes import Refusal
from app.core.types import ColourImage, DepthImage, Poses, ToolPose
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.physics import HOME_TOOL_M
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.rope_push import TASK

Place: TypeAlias = Literal["here", "aside", "covered"]
"""Place of the rope: here, 40 mm aside, or out of sight under the table."""

_ROPE_M: Mapping[Place, tuple[float, float]] = {"here": (0.54, 0.008), "aside": (0.58, 0.008), "covered": (0.54, -0.3)}
"""x and z [m] of a straight rope along y, for each place."""
_TAKES = 3
_MAX_TICKS = 3.0


@lru_cache
def small_cameras() -> tuple[CameraModel, ...]:
    """The simulated rig's cameras at half their resolution."""
    return tuple(
        dataclasses.replace(camera, width=320, height=240, K=np.diag([0.5, 0.5, 1.0]) @ camera.K)
        for camera in table_cameras()
    )


@lru_cache
def photographs() -> Mapping[tuple[Place, str], Sequence[tuple[ColourImage, DepthImage]]]:
    """Some pictures of each place by each camera, which differ in their noise."""
    rng, y = np.random.default_rng(0), np.linspace(-0.2, 0.2, 41)
    home = pointing_down(np.array(HOME_TOOL_M))
    pictures: dict[tuple[Place, str], list[tuple[ColourImage, DepthImage]]] = {}
    for place, (x_m, z_m) in _ROPE_M.items():
        rope = np.stack([np.full_like(y, x_m), y, np.full_like(y, z_m)], axis=1)
        world = Snapshot(time_s=0.0, nodes=rope, tool=home, joints=solve_joints(home))
        for camera in small_cameras():
            pictures[place, camera.name] = [render(world, camera, rng, stage=TASK.stage) for _ in range(_TAKES)]
    return pictures


@final
class Table:
    """Place of the rope on the table; a test moves it by hand."""

    def __init__(self) -> None:
        self.place: Place = "here"


@final
class PhotographicCamera:
    """Shows what lies on the table. While it is `broken` it raises DeviceError, as a camera does that times out."""

    def __init__(self, model: CameraModel, table: Table, period_s: float) -> None:
        self._model, self._table, self._period_s = model, table, period_s
        self._taken = 0
        self.broken = False

    @property
    def model(self) -> CameraModel:
        return self._model

    @property
    def words(self) -> str:
        return "its cable is loose" if self.broken else ""

    async def read(self) -> Frame:
        await anyio.sleep(self._period_s)
        if self.broken:
            raise DeviceError(f"Camera {self._model.name!r} gave no image; check its cable.")
        self._taken += 1
        color, depth = photographs()[self._table.place, self._model.name][self._taken % _TAKES]
        return Frame(id=fresh_id("frame"), time_s=anyio.current_time(), camera=self._model, color=color, depth=depth)


@final
class TickedArm:
    """The control loop of the simulated arm, run by the event loop while a motion lasts.

    `site` is the arm's own, which may be narrower than the planner's. `begun` holds the approvals it has moved for.
    """

    def __init__(self, site: Site) -> None:
        self.begun: list[MessageId] = []
        self._approvals = UsedApprovals()
        self._stop_s = self._reset_s = 0.0
        self._heeding, self._told, self._jogged_s = False, list[Jog](), 0.0
        self._tool = pointing_down(np.array(HOME_TOOL_M))
        self.obey(site)

    def obey(self, site: Site) -> None:
        """Keep to the limits of `site` from now on; for an arm at rest."""
        self._site = site
        self._control = ArmControl(site, self._tool)

    async def state(self) -> ArmState:
        control = self._control
        return ArmState(
            id=fresh_id("state"),
            time_s=anyio.current_time(),
            pose=control.measured[:7].copy(),
            velocity=control.velocity.copy(),
            joints=solve_joints(control.measured),
            gripper=1.0,
            mode=control.mode,
            period_s=self._site.timing.arm_period_s,
            reason=control.reason,
        )

    async def execute(self, approved: Approved) -> Executed:
        self._approvals.use(approved)
        begin(self._control, approved.motion, approved.digest, self._site)
        self.begun.append(approved.id)
        try:
            times_s, commanded, measured = await self._followed()
        finally:
            # Of no effect on a motion that has ended; one that nobody watches any more must not go on.
            if self._control.mode == "moving":
                self.stop()
        outcome = self._outcome()
        reason = self._control.reason
        # The end of a motion is noticed a little after it, as it is by whoever feeds a watchdog.
        await anyio.sleep(self._site.timing.keepalive_s)
        return Executed(
            id=fresh_id("executed"),
            cause=(approved.id,),
            time_s=float(times_s[-1]),
            approved_id=approved.id,
            outcome=outcome,
            reason=reason,
            times_s=times_s,
            commanded=commanded,
            measured=measured,
        )

    def joints(self) -> np.ndarray:
        return solve_joints(self._control.measured)

    def tool(self) -> ToolPose:
        return self._control.measured.copy()

    def jog(self, jog: Jog) -> bool:
        if self._heeding and self._control.mode not in ("stopping", "stopped"):
            self._told.append(jog)
            return True
        return False

    async def accept_jogs(self, over: anyio.Event | None = None) -> Executed | None:
        if self._control.mode != "idle":
            raise MotionRefused(
                Refusal.BUSY, f"The arm is {self._control.mode}; wait for its end, or reset it after a stop."
            )
        self._heeding = True
        try:
            rows, reason = await self._stretch(over)
        finally:
            self._heeding = False
            self._told.clear()
            while self._control.mode in ("moving", "stopping"):
                self._control.decelerate()
                self._control.advance(self._site.timing.arm_period_s)
            self._tool = self._control.commanded
        if not rows:
            return None
        times_s, commanded, measured = (np.array(column) for column in zip(*rows, strict=True))
        return Executed(
            id=fresh_id("executed"),
            time_s=float(times_s[-1]),
            approved_id=fresh_id("jogged"),
            outcome=self._outcome(),
            reason=self._control.reason or reason,
            times_s=times_s,
            commanded=commanded[:, :7],
            measured=measured[:, :7],
            openings=measured[:, 7],
        )

    @property
    def held(self) -> bool:
        return self._stop_s > self._reset_s

    def trips(self) -> None:
        """Stop as the watchdog of the arm's own process does."""
        self._control.stop("Watchdog: nothing was heard.")

    def stop(self) -> None:
        self._stop_s = anyio.current_time()
        self._control.stop("STOP was pressed.")

    async def reset(self, *, asked_s: float) -> None:
        if self._stop_s > asked_s or self._control.mode == "stopping":
            raise DeviceError("The arm did not lift its stop; it was stopped again since, or is not at rest yet.")
        self._reset_s = asked_s
        self._control.reset()

    async def _stretch(self, over: anyio.Event | None) -> tuple[list[tuple[float, ToolPose, ToolPose]], str]:
        """Tick while somebody jogs: times, commanded and measured poses from the first move to rest."""
        control, timing = self._control, self._site.timing
        rows, last_s, rested_s, reason = list[tuple[float, ToolPose, ToolPose]](), anyio.current_time(), 0.0, ""
        while rested_s < timing.jog_rest_s:
            await anyio.sleep(timing.arm_period_s)
            now_s = anyio.current_time()
            if over is not None and over.is_set():
                self._heeding = False
                self._told.clear()
                if not rows:
                    return rows, reason
            if self._told and control.jog(self._told[-1]):
                self._jogged_s = now_s
            elif not self._heeding or now_s - self._jogged_s > timing.watchdog_s:
                control.decelerate()
            self._told.clear()
            control.advance(min(now_s - last_s, _MAX_TICKS * timing.arm_period_s))
            if control.mode == "moving" or (rows and control.mode == "stopping"):
                rested_s = 0.0
                rows.append((now_s, control.commanded.copy(), control.measured.copy()))
            elif rows:
                rested_s += now_s - last_s
            if control.mode == "stopped" and not rows:
                raise MotionRefused(Refusal.STOPPED, "A stop is in force; press Resume, then move the tool again.")
            if control.mode == "stopped":
                break
            if rows and now_s - rows[0][0] > timing.jog_longest_s:
                self._heeding, reason = False, "Moved by hand for as long as may be without a rest."
            last_s = now_s
        return rows, reason

    def _outcome(self) -> Literal["completed", "stopped"]:
        return "completed" if self._control.mode == "idle" else "stopped"

    async def _followed(self) -> tuple[np.ndarray, Poses, Poses]:
        """Tick until the arm is at rest: times, commanded and measured poses."""
        control, period_s = self._control, self._site.timing.arm_period_s
        rows, last_s = list[tuple[float, np.ndarray, np.ndarray]](), anyio.current_time()
        while control.mode in ("moving", "stopping"):
            await anyio.sleep(period_s)
            now_s = anyio.current_time()
            control.advance(min(now_s - last_s, _MAX_TICKS * period_s))
            last_s = now_s
            rows.append((now_s, control.commanded.copy(), control.measured.copy()))
        self._tool = control.commanded
        times_s, commanded, measured = (np.array(column) for column in zip(*rows, strict=True))
        return times_s, commanded[:, :7], measured[:, :7]


@final
class SmallRig:
    """Two cameras, calibrated on that day, and an arm in this process."""

    def __init__(self, site: Site, *, simulated: bool = True, calibrated_at: str = "") -> None:
        self.table = Table()
        self._simulated = simulated
        period_s = site.timing.camera_period_s
        models = [dataclasses.replace(model, calibrated_at=calibrated_at) for model in small_cameras()]
        self._cameras = [PhotographicCamera(model, self.table, period_s) for model in models]
        self._arm = TickedArm(site)

    @property
    def name(self) -> str:
        return "small"

    @property
    def simulated(self) -> bool:
        return self._simulated

    @property
    def shape(self) -> ArmShape:
        return known_arm(TASK.stage.tool)

    @property
    def seen_arm(self) -> TickedArm:
        return self._arm

    @property
    def cameras(self) -> Sequence[PhotographicCamera]:
        return self._cameras

    @property
    def arm(self) -> TickedArm:
        return self._arm
