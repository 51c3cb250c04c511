"""The simulated cell, seen as a real one is: its images take the way of RealSense cameras, through their SDK."""

from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import final

from anyio import to_thread

from app.arm.process import Controlled
from app.config import Site
from app.core.limbs import ArmShape
from app.core.ports import Arm, Camera
from app.core.stage import Stage
from app.rig.realsense.camera import RealSenseCamera
from app.rig.realsense.cameras import realsense_cameras
from app.rig.realsense.ladder import Patience
from app.rig.realsense.mounted import Mounted
from app.rig.realsense.rendered import Feed, Rendered
from app.rig.realsense.settings import Settings
from app.rig.realsense.software import Body
from app.rig.simulated.cameras import table_cameras
from app.rig.simulated.held_board import HeldBoard
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.rig.simulated.world import Nodes, Snapshot

_PATIENT = Patience(late_s=5.0)
"""What is rendered comes when the machine has time for it."""


@final
class RehearsedRig:
    """The arm and the world of a simulated rig with RealSense cameras."""

    def __init__(self, world: SimulatedRig, cameras: Sequence[RealSenseCamera]) -> None:
        self._world, self._cameras = world, cameras

    @property
    def name(self) -> str:
        """For the log and the console."""
        return "simulated, seen through the RealSense SDK"

    @property
    def simulated(self) -> bool:
        """Nothing real can move."""
        return True

    @property
    def shape(self) -> ArmShape:
        """The arm as it is drawn."""
        return self._world.shape

    @property
    def cameras(self) -> Sequence[Camera]:
        """Views from around the table."""
        return self._cameras

    @property
    def arm(self) -> Arm:
        """The simulated one."""
        return self._world.arm

    def truth(self) -> Snapshot:
        """The world as it is."""
        return self._world.truth()


@asynccontextmanager
async def rehearsed_rig(
    *,
    stage: Stage,
    start: Nodes,
    site: Site,
    seed: int,
    held: HeldBoard | None = None,
    take: Controlled | None = None,
) -> AsyncGenerator[RehearsedRig]:
    """A rig as `simulated_rig` opens it, whose cameras have imagers of their own for depth, which the SDK aligns.

    Raises DeviceError on entry where a process does not come up.
    """
    models = table_cameras()
    bodies = {model.name: Body.like_d435(model, f"rehearsal-{model.name}") for model in models}
    depth = {model.name: bodies[model.name].depth_view(model) for model in models}
    opening = simulated_rig(
        stage=stage, start=start, site=site, seed=seed, cameras=models, depth_views=depth, held=held, take=take
    )
    async with opening as world:
        mounted = [
            Mounted(
                name=model.name,
                source=Rendered(body=bodies[model.name], feed=await to_thread.run_sync(Feed, world.images[model.name])),
                T_world_camera=model.T_world_camera,
                settings=Settings(width=model.width, height=model.height, warm_up=0),
            )
            for model in models
        ]
        # The world's cameras keep the site's period themselves.
        timing = replace(site.timing, camera_period_s=0.0)
        async with realsense_cameras(mounted, timing, patience=_PATIENT) as cameras:
            yield RehearsedRig(world, cameras)
