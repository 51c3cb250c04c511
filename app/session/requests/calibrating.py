"""Camera calibration from the console: detections of the board, views as they are taken, and their solution."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import TypeAlias, final

import anyio
import numpy as np
from scipy.spatial.transform import Rotation

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.camera_calibration_messages import BoardSeen, Checked, Placed, Placing, TakenView
from app.core.dialogue.control import ModeName
from app.core.dialogue.requests import CalibrationRequest
from app.core.errors import DeviceError, DipacError, PerceptionError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import Agreement, HandEye, LastCheck
from app.core.geometry.lens import Lens
from app.core.messages import ArmState, Frame, fresh_id
from app.core.ports import CameraShelf, Clock, Computers, Rig
from app.core.system.channel import Latest
from app.core.system.worker import Worker
from app.core.types import Transform
from app.perception.calibration.assess import Assessment, Target, assess
from app.perception.calibration.drift import drift
from app.perception.calibration.se3 import angle, inverse, transform
from app.perception.calibration.sight import BoardDetection, sight
from app.perception.calibration.solve import CalibrationView
from app.session.requests.wait_until_still import until_at_rest

Frames: TypeAlias = Mapping[str, Latest[Frame]]
"""The newest of each camera, by its name."""

_BY_HAND: tuple[ModeName, ...] = ("idle", "teleoperate")
_FRAME_S, _REST_S = 10.0, 20.0
_STILL_M, _STILL_RAD = 0.0005, np.radians(0.05)
"""Tolerance on the reported motion of an arm at rest while it is photographed."""


@final
class Calibrating:
    """One camera at a time. `shelf`: where calibrations are kept; without one, none is."""

    def __init__(
        self,
        rig: Rig,
        frames: Frames,
        shelf: CameraShelf | None,
        site: Site,
        announcer: MessageBus,
        clock: Clock,
        computers: Computers = Worker,
    ) -> None:
        self._rig, self._frames, self._shelf, self._site = rig, frames, shelf, site
        self._announcer, self._clock = announcer, clock
        self._worker = computers("calibration", niceness=5)
        self._models = {camera.model.name: camera.model for camera in rig.cameras}
        self._target: Target | None = None
        self._kept: HandEye | None = None
        self._views, self._checked = list[CalibrationView](), tuple[Checked, ...]()
        self._assessed: Assessment | None = None
        self._begun = anyio.Event()

    async def run(self) -> None:
        """Look for the board in the frames of the camera that is calibrated, for ever."""
        async with self._worker:
            while True:
                await self._begun.wait()
                target = self._target
                if target is None:
                    self._begun = anyio.Event()
                    continue
                async for frame in self._frames[target.serial].changes():
                    if self._target is not target:
                        break
                    await self._look(frame, target)

    async def handle(self, request: CalibrationRequest, mode: ModeName) -> None:
        """Execute a request, or say why not."""
        try:
            await self._do(request, mode)
        except DipacError as error:
            self._announcer.notice("calibration", str(error), request.id)
            if self._target is not None:
                self._say(self._target, said=str(error))

    async def _do(self, request: CalibrationRequest, mode: ModeName) -> None:
        if request.act == "begin":
            await self._begin(request)
            return
        target = self._target
        if target is None:
            raise UsageError("No camera is being calibrated; begin with one.")
        match request.act:
            case "take":
                self._views.append(await self._view(target, mode))
                await self._assess(target)
            case "drop":
                self._views = self._views[:-1]
                await self._assess(target)
            case "check":
                await self._check(target, mode)
            case "save":
                await self._save(target, request)
            case "end":
                self._target = None
                self._say(target, under_way=False)

    async def _begin(self, request: CalibrationRequest) -> None:
        model = self._models.get(request.camera)
        if model is None:
            raise UsageError.unknown("camera", request.camera, self._models)
        self._target = Target(
            serial=model.name,
            pose=model.T_world_camera,
            lens=Lens(width=model.width, height=model.height, K=model.K),
            board=replace(Charuco(), square_m=request.square_m, marker_m=request.marker_m),
        )
        self._kept = await self._shelf.kept(model.name) if self._shelf else None
        self._views, self._checked, self._assessed = [], (), None
        self._begun.set()
        self._say(self._target, said="Bring the board before the camera, let the arm rest, and take a view.")

    async def _view(self, target: Target, mode: ModeName) -> CalibrationView:
        """The board in a frame that was taken while the arm was at rest. Raises DipacError where that cannot be."""
        if mode not in _BY_HAND:
            raise UsageError("Views are taken in the modes Idle and By hand, in which nothing is planned; choose one.")
        with self._clock.move_on_after(_REST_S) as waiting:
            await until_at_rest(self._rig.arm, self._site.timing, self._clock)
        if waiting.cancelled_caught:
            raise DeviceError("The arm does not come to rest; let go of it, and take the view again.")
        before = await self._rig.arm.state()
        frame = await self._newer(target, self._clock.now())
        seen = await self._worker.run(sight, frame.color, target.board, target.lens)
        after = await self._rig.arm.state()
        if _has_moved(before, after):
            raise DeviceError("The arm moved while the view was taken; let it rest, and take it again.")
        return CalibrationView(sight=seen, T_world_gripper=_transform(before))

    async def _newer(self, target: Target, due_s: float) -> Frame:
        with self._clock.move_on_after(_FRAME_S):
            async for frame in self._frames[target.serial].changes():
                if frame.time_s >= due_s:
                    return frame
        raise DeviceError(f"Camera {target.serial!r} gave no new image in {_FRAME_S:.0f} s; look at its messages.")

    async def _assess(self, target: Target) -> None:
        self._assessed = None
        if self._views:
            box, today = self._site.limits.workspace, datetime.now(UTC).date()
            self._assessed = await self._worker.run(assess, self._views, target, box, today)
        lacks = self._assessed.lacks if self._assessed else "No view is left; take some."
        self._say(target, said=lacks or "The camera is placed; more views make it surer, and Save keeps it.")

    async def _check(self, target: Target, mode: ModeName) -> None:
        """One fresh view against what was kept, which warns where that holds no more."""
        if self._kept is None:
            raise UsageError(f"No calibration of camera {target.serial!r} was kept that could be checked; make one.")
        found = drift(self._kept, await self._view(target, mode))
        verdict: Agreement = "differs" if found.beyond else "agrees"
        noted = LastCheck(day=datetime.now(UTC).date(), verdict=verdict, said=str(found))
        self._kept = replace(self._kept, place=noted)
        self._checked = (Checked(moved_m=found.moved_m, turned_deg=found.turned_deg, beyond=found.beyond),)
        self._say(target, said=str(found))
        self._announcer.notice("calibration", f"Camera {target.serial!r}: {found}")
        if self._shelf is not None:
            await self._shelf.keep(self._kept)

    async def _save(self, target: Target, request: CalibrationRequest) -> None:
        solved = self._assessed.solved if self._assessed else None
        if solved is None:
            raise UsageError("There is no result to keep yet; take views until the camera is placed.")
        if self._shelf is None:
            raise UsageError("This session keeps no calibrations; use `dipac console`.")
        where = await self._shelf.keep(solved.found)
        self._kept = solved.found
        text = f"{request.operator} kept camera {target.serial!r} in {where}; it is in use from the next start on."
        self._announcer.notice("calibration", text, request.id)
        self._say(target, said=text)

    async def _look(self, frame: Frame, target: Target) -> None:
        try:
            seen, why = await self._worker.run(sight, frame.color, target.board, target.lens), ""
        except PerceptionError as error:
            seen, why = None, str(error)
        except DipacError as error:
            self._announcer.fault("calibration", error)
            return
        if self._target is target:
            self._announcer.say(_board_message(frame, seen, why, target))

    def _say(self, target: Target, *, said: str = "", under_way: bool = True) -> None:
        assessed = self._assessed
        best = assessed.next_pose if assessed else None
        self._announcer.say(
            Placing(
                id=fresh_id("placing"),
                time_s=self._clock.now(),
                camera=target.serial,
                under_way=under_way,
                views=_taken_views(assessed) if assessed else (),
                spread=(assessed.spread,) if assessed else (),
                placed=_placements(assessed, target) if assessed else (),
                checked=self._checked,
                next_pose=_pose(best.T_world_gripper)[None] if best else np.zeros((0, 7)),
                promised_m=best.promised_m if best else float("nan"),
                said=said,
                kept_at=self._kept.known_at.isoformat() if self._kept else "",
            )
        )


def _board_message(frame: Frame, seen: BoardDetection | None, why: str, target: Target) -> BoardSeen:
    middle = np.array([*target.board.size_m, 0.0]) / 2
    place = seen.T_camera_board[:3, :3] @ middle + seen.T_camera_board[:3, 3] if seen else np.full(3, np.nan)
    return BoardSeen(
        id=fresh_id("board"),
        cause=(frame.id,),
        time_s=frame.time_s,
        camera=target.serial,
        corners=seen.pixels.astype(np.float32) if seen else np.zeros((0, 2), np.float32),
        error_px=seen.error_px if seen else float("nan"),
        distance_m=float(np.linalg.norm(place)),
        why=why,
    )


def _taken_views(assessed: Assessment) -> tuple[TakenView, ...]:
    solved, count = assessed.solved, len(assessed.tilts_deg)
    nothing = np.full(count, np.nan)
    px, m, deg = (solved.refined.error_px, solved.view_error_m, solved.view_error_deg) if solved else (nothing,) * 3
    out = solved.outliers if solved else ()
    return tuple(
        TakenView(
            tilt_deg=(float(assessed.tilts_deg[index, 0]), float(assessed.tilts_deg[index, 1])),
            error_px=float(px[index]),
            error_m=float(m[index]),
            error_deg=float(deg[index]),
            outlier=index in out,
        )
        for index in range(count)
    )


def _placements(assessed: Assessment, target: Target) -> tuple[Placed, ...]:
    if assessed.solved is None:
        return ()
    found = assessed.solved.found
    return (
        Placed(
            pose=found.pose,
            deviation_m=found.deviation_m,
            deviation_deg=found.deviation_deg,
            error_px=found.error_px,
            moved_m=float(np.linalg.norm(found.pose[:3, 3] - target.pose[:3, 3])),
            turned_deg=float(np.degrees(angle((inverse(target.pose) @ found.pose)[:3, :3]))),
        ),
    )


def _transform(state: ArmState) -> Transform:
    return transform(Rotation.from_quat(state.pose[3:], scalar_first=True).as_matrix(), state.pose[:3])


def _pose(T: Transform) -> np.ndarray:
    return np.concatenate([T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True)])


def _has_moved(before: ArmState, after: ArmState) -> bool:
    by = inverse(_transform(before)) @ _transform(after)
    return float(np.linalg.norm(by[:3, 3])) > _STILL_M or float(angle(by[:3, :3])) > float(_STILL_RAD)
