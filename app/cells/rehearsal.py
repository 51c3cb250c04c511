"""The whole software of a real cell without hardware: a Gen3's protocol, and the SDK of its cameras.

The arm is commanded over Kinova's wire protocol, which an emulator answers as the firmware does; its tool moves the
simulated world; the rendered images pass through the SDK of RealSense cameras.
"""

from collections.abc import AsyncGenerator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final, final

from anyio import to_thread

from app.cells.base import Cell, Wanted
from app.cells.cell_file import load_cell, narrowed_by
from app.cells.simulated import drawn_geometry
from app.config import Site
from app.core.geometry.arm_geometry import ArmShape
from app.core.ports import Arm, Camera
from app.rig.kinova.client.link import Address
from app.rig.kinova.control import connect_arm
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.feedback_conversion import ArmFeedback
from app.rig.kinova.gen3 import GRIPPER_M, Joints, reach_over
from app.rig.realsense.camera import RealSenseCamera
from app.rig.realsense.camera_mounts import Mounted
from app.rig.realsense.cameras import realsense_cameras
from app.rig.realsense.recovery_policy import RecoveryTimeouts
from app.rig.realsense.sdk.rendered import Feed, Rendered
from app.rig.realsense.sdk.software import CameraDescription
from app.rig.realsense.settings import StreamSettings
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.held_board import HeldBoard
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot

_PATIENT = RecoveryTimeouts(late_s=5.0)
"""Timeouts for rendered images, which come when the machine has time for them."""


@final
class Rehearsal:
    """A simulated world with the arm and the cameras of a real cell. `fake`: the emulated arm, for fault injection."""

    def __init__(self, world: SimulatedRig, cameras: Sequence[RealSenseCamera], fake: FakeProcess) -> None:
        self._world, self._cameras, self.fake = world, cameras, fake

    @property
    def name(self) -> str:
        """Name for the log and the console."""
        return "rehearsal"

    @property
    def simulated(self) -> bool:
        """True: nothing real can move."""
        return True

    @property
    def shape(self) -> ArmShape:
        """Geometry of the drawn arm."""
        return self._world.shape

    @property
    def seen_arm(self) -> Arm:
        """The arm in the images, which is `arm`."""
        return self._world.arm

    @property
    def cameras(self) -> Sequence[Camera]:
        """Views from around the table."""
        return self._cameras

    @property
    def arm(self) -> Arm:
        """The emulated Gen3."""
        return self._world.arm

    def truth(self) -> Snapshot:
        """Ground truth of the world."""
        return self._world.truth()


@asynccontextmanager
async def _open_cell(wanted: Wanted) -> AsyncGenerator[Rehearsal]:
    """Open the cell. Raises DeviceError on entry where a process does not start."""
    models = table_cameras()
    bodies = {model.name: CameraDescription.like_d435(model, f"rehearsal-{model.name}") for model in models}
    depth = {model.name: bodies[model.name].depth_view(model) for model in models}
    site = wanted.site
    async with AsyncExitStack() as opened:
        fake = await to_thread.run_sync(FakeProcess)
        await to_thread.run_sync(fake.__enter__)
        opened.push_async_callback(to_thread.run_sync, partial(fake.__exit__, None, None, None))
        take = partial(
            connect_arm,
            Address(host=fake.host, tcp_port=fake.ports[0], udp_port=fake.ports[1]),
            joints_of=_drawn_joints,
        )
        world = await opened.enter_async_context(
            simulated_rig(
                stage=wanted.stage,
                start=wanted.start,
                site=site,
                seed=wanted.seed,
                cameras=models,
                depth_views=depth,
                held=HeldBoard() if wanted.board else None,
                take=take,
            )
        )
        mounted = [
            Mounted(
                name=model.name,
                source=Rendered(body=bodies[model.name], feed=await to_thread.run_sync(Feed, world.images[model.name])),
                T_world_camera=model.T_world_camera,
                settings=StreamSettings(width=model.width, height=model.height, warm_up=0),
            )
            for model in models
        ]
        # The world's cameras keep the site's period themselves.
        timing = replace(site.timing, camera_period_s=0.0)
        cameras = await opened.enter_async_context(realsense_cameras(mounted, timing, timeouts=_PATIENT))
        yield Rehearsal(world, cameras, fake)


def _narrow_site(site: Site, file: Path | None) -> Site:
    """The site within a Gen3's reach: the commanded arm is one, whatever is drawn. A real cell's file may be given."""
    own = site if file is None else narrowed_by(load_cell(file), site)
    return replace(own, limits=replace(own.limits, reach=reach_over(own.table, GRIPPER_M)))


def _drawn_joints(seen: ArmFeedback) -> Joints:
    """Joint angles of the drawn arm with its tool at this one's: a Gen3's links are shorter."""
    return solve_joints(seen.tool)


CELL: Final = Cell(name="rehearsal", simulated=True, open=_open_cell, narrowed=_narrow_site, pictured=drawn_geometry)
