"""The whole of a real cell's software with nothing real in it: a Gen3's protocol, and the SDK of its cameras.

The arm is told what to do over Kinova's wire, by an arm that is not there but answers as its firmware does; what its
tool does moves the simulated world; what is rendered of that passes the SDK of RealSense cameras.
"""

from collections.abc import AsyncGenerator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from functools import partial
from typing import Final, final

from anyio import to_thread

from app.cells.base import Cell, Wanted, as_it_is
from app.core.ports import Arm, Camera
from app.rig.kinova.control import taken
from app.rig.kinova.fake.process import FakeProcess
from app.rig.kinova.link import Address
from app.rig.realsense.camera import RealSenseCamera
from app.rig.realsense.cameras import Mounted, realsense_cameras
from app.rig.realsense.ladder import Patience
from app.rig.realsense.rendered import Feed, Rendered
from app.rig.realsense.settings import Settings
from app.rig.realsense.software import Body
from app.rig.simulated.cameras import table_cameras
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.rig.simulated.world import Snapshot

_PATIENT = Patience(late_s=5.0)
"""What is rendered comes when the machine has time for it."""


@final
class Rehearsal:
    """A simulated world with the arm and the cameras of a real cell. `fake`: the arm's firmware, to do faults to."""

    def __init__(self, world: SimulatedRig, cameras: Sequence[RealSenseCamera], fake: FakeProcess) -> None:
        self._world, self._cameras, self.fake = world, cameras, fake

    @property
    def name(self) -> str:
        """For the log and the console."""
        return "rehearsal"

    @property
    def simulated(self) -> bool:
        """Nothing real can move."""
        return True

    @property
    def shape(self) -> None:
        """Nobody knows: the world draws another arm than the one whose joints are told."""
        return None

    @property
    def cameras(self) -> Sequence[Camera]:
        """Views from around the table."""
        return self._cameras

    @property
    def arm(self) -> Arm:
        """The Gen3 that is not there."""
        return self._world.arm

    def truth(self) -> Snapshot:
        """The world as it is."""
        return self._world.truth()


@asynccontextmanager
async def _opened(wanted: Wanted) -> AsyncGenerator[Rehearsal]:
    """Raises DeviceError on entry where a process does not come up."""
    models = table_cameras()
    bodies = {model.name: Body.like_d435(model, f"rehearsal-{model.name}") for model in models}
    depth = {model.name: bodies[model.name].depth_view(model) for model in models}
    task, site, seed = wanted.task, wanted.site, wanted.seed
    async with AsyncExitStack() as opened:
        fake = await to_thread.run_sync(FakeProcess().__enter__)
        opened.push_async_callback(to_thread.run_sync, partial(fake.__exit__, None, None, None))
        take = partial(taken, Address(host=fake.host, tcp_port=fake.ports[0], udp_port=fake.ports[1]))
        world = await opened.enter_async_context(
            simulated_rig(
                stage=task.stage,
                start=task.start(seed),
                site=site,
                seed=seed,
                cameras=models,
                depth_views=depth,
                take=take,
            )
        )
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
        cameras = await opened.enter_async_context(realsense_cameras(mounted, timing, patience=_PATIENT))
        yield Rehearsal(world, cameras, fake)


CELL: Final = Cell(name="rehearsal", simulated=True, open=_opened, narrowed=as_it_is)
