"""A camera calibrated step by step, as the console asks for it: views at rest, a result, kept, and checked later."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import anyio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.config import Limits, Site, Timing, Workspace
from app.core.announcer import MessageBus
from app.core.dialogue.camera_calibration_messages import BoardSeen, Placing
from app.core.dialogue.control import ModeName
from app.core.dialogue.requests import CalibrationAct, CalibrationRequest, Request
from app.core.dialogue.summary import Summary
from app.core.geometry.camera import CameraModel
from app.core.messages import ArmState, Frame, Message, Notice, fresh_id
from app.core.system.channel import Latest
from app.perception.calibration.se3 import exp, inverse, transform
from app.recording.exchange.calibration_file import CalibrationFile
from app.session.requests.calibrating import Calibrating
from bench.boards import LENS, Camera, cell, image
from tests.session.cell import MemoryLog
from tests.session.virtual import InsideWorker, VirtualClock

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TRUTH = cell(0, 9)
BOX = Workspace(low=(-2.0, -2.0, -2.0), high=(2.0, 2.0, 2.0))
SITE = Site(limits=Limits(workspace=BOX), timing=Timing(jog_rest_s=0.05, keepalive_s=0.02))


class OneArm:
    """An arm that is where a test puts it, and moves on by itself while it is `restless`."""

    def __init__(self) -> None:
        self.gripper = TRUTH.grippers[0]
        self.restless = False

    async def state(self) -> ArmState:
        if self.restless:
            self.gripper = self.gripper @ transform(np.eye(3), np.array([0.001, 0.0, 0.0]))
        turn = Rotation.from_matrix(self.gripper[:3, :3]).as_quat(scalar_first=True)
        return ArmState(
            id=fresh_id("state"),
            time_s=anyio.current_time(),
            pose=np.array([*self.gripper[:3, 3], *turn]),
            velocity=np.zeros(3),
            joints=np.zeros(7),
            gripper=1.0,
            mode="idle",
            period_s=0.01,
        )


class Calibrated:
    """A calibration under way. `knocked`: where the camera is instead of where it was."""

    def __init__(self, path: Path) -> None:
        self.arm, self.knocked, self.seen = OneArm(), np.eye(4), list[Message]()
        self.model = CameraModel(
            name="camera0", width=640, height=480, K=LENS.K, T_world_camera=TRUTH.X, depth_unit_m=0.001
        )
        self.frames = {"camera0": Latest[Frame]("frames")}
        announcer = MessageBus(operator=self, recorder=MemoryLog(), clock=VirtualClock(), summary=Summary())
        self.stage = Calibrating(
            self, self.frames, CalibrationFile(path), SITE, announcer, VirtualClock(), InsideWorker
        )
        self._rng = np.random.default_rng(0)

    @property
    def name(self) -> str:
        return "one"

    @property
    def simulated(self) -> bool:
        return True

    @property
    def cameras(self) -> "Sequence[Calibrated]":
        return [self]

    def show(self, message: Message) -> None:
        self.seen.append(message)

    async def requests(self) -> AsyncIterator[Request]:
        for request in list[Request]():
            yield request

    async def photograph(self) -> None:
        """Put pictures of the board where the arm holds it, for ever."""
        while True:
            C = inverse(TRUTH.X @ self.knocked) @ self.arm.gripper @ TRUTH.Y
            taken = image(C, Camera(), self._rng)
            depth = np.zeros(taken.shape[:2], np.uint16)
            self.frames["camera0"].put(
                Frame(id=fresh_id("frame"), time_s=anyio.current_time(), camera=self.model, color=taken, depth=depth)
            )
            await anyio.sleep(0.1)

    async def asks(self, act: CalibrationAct, mode: ModeName = "teleoperate", camera: str = "camera0") -> Message:
        """Answer to a request of calibration: the last message about it."""
        request = CalibrationRequest(
            id=fresh_id("request"), time_s=anyio.current_time(), operator="client 1", act=act, camera=camera
        )
        await self.stage.handle(request, mode)
        return [message for message in self.seen if isinstance(message, Placing | Notice)][-1]

    async def says(self, act: CalibrationAct, **how) -> Placing:
        said = await self.asks(act, **how)
        assert isinstance(said, Placing), said
        return said

    async def sees(self, wanted: bool) -> BoardSeen:
        """The next view of the board in which it is found, or is not."""
        begun = len(self.seen)
        with anyio.fail_after(30):
            while True:
                for message in self.seen[begun:]:
                    if isinstance(message, BoardSeen) and bool(len(message.corners)) == wanted:
                        return message
                await anyio.sleep(0.02)


@asynccontextmanager
async def calibrating(path: Path) -> AsyncIterator[Calibrated]:
    run = Calibrated(path)
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(run.photograph)
        tasks.start_soon(run.stage.run)
        yield run
        tasks.cancel_scope.cancel()


async def test_a_camera_is_calibrated_view_by_view_kept_and_checked(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    async with calibrating(path) as run:
        assert (await run.says("begin")).kept_at == ""
        board = await run.sees(True)
        assert len(board.corners) == 24
        assert board.distance_m == pytest.approx(0.5, abs=0.2)
        first = await run.says("take")
        assert "5 are needed" in first.said
        assert first.next_pose.shape == (1, 7)
        for gripper in TRUTH.grippers[1:8]:
            run.arm.gripper = gripper
            last = await run.says("take")
        assert len(last.views) == 8
        (placed,) = last.placed
        assert placed.moved_m < 2e-3
        assert placed.turned_deg < 0.2
        assert max(placed.deviation_m) < 2e-3
        assert max(view.error_deg for view in last.views) < 0.3
        assert len((await run.says("drop")).views) == 7
        kept = await run.says("save")
        assert "client 1 kept camera 'camera0'" in kept.said
        found = await CalibrationFile(path).kept("camera0")
        assert found is not None
        assert found.views == 7
        run.arm.gripper = TRUTH.grippers[8]
        await run.asks("check")
        holds = [message for message in run.seen if isinstance(message, Placing)][-1]
        assert not holds.checked[0].beyond
        checked = await CalibrationFile(path).kept("camera0")
        assert checked is not None
        assert checked.place is not None
        assert checked.place.verdict == "agrees"
        assert holds.kept_at == checked.place.day.isoformat()
        run.knocked = transform(exp(np.radians([0.0, 1.0, 0.0])), np.array([0.0, 0.006, 0.0]))
        said = await run.asks("check")
        assert isinstance(said, Notice)
        assert "calibrate again" in said.text
        moved = await CalibrationFile(path).kept("camera0")
        assert moved is not None
        assert "calibrate again" in moved.doubt
        assert not (await run.says("end")).under_way


async def test_a_view_that_would_deceive_is_refused_in_words(tmp_path: Path) -> None:
    async with calibrating(tmp_path / "calibration.toml") as run:
        await run.asks("take")
        for act, camera, said in (("take", "camera0", "begin with one"), ("begin", "camera7", "Unknown camera")):
            notice = await run.asks(act, camera=camera)
            assert isinstance(notice, Notice)
            assert said in notice.text
        await run.says("begin")
        assert "Idle and By hand" in (await run.says("take", mode="automatic")).said
        assert "no result to keep" in (await run.says("save")).said
        assert "could be checked" in (await run.says("check")).said
        run.arm.restless = True
        assert "moved while" in (await run.says("take")).said
        run.arm.restless = False
        run.arm.gripper = TRUTH.grippers[0] @ transform(exp(np.array([np.pi, 0.0, 0.0])), np.array([0.0, 0.0, 3.0]))
        unseen = await run.sees(False)
        assert "not in the image" in unseen.why
        assert "not in the image" in (await run.says("take")).said
