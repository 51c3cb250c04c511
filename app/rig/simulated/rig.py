"""The simulated rig: arm, world and cameras, each in a process of its own, behind the ports of `core`."""

import os
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import final

import anyio
from anyio import to_thread

from app.arm.memory import ArmMemory
from app.arm.process import Controlled, run_arm
from app.arm.process_arm import ProcessArm
from app.config import Site
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.core.ports import Arm, Camera
from app.core.shared_memory_camera import image_ring
from app.core.system.processes import end, process, ready
from app.core.system.ring import Ring
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.cameras.camera import SimulatedCamera
from app.rig.simulated.cameras.camera_process import run_cameras
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.held_board import HeldBoard
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.world_process import newest_snapshot, run_world, snapshot_ring
from app.rig.simulated.worlds.world import Nodes, Snapshot

_IMAGES_KEPT = 3


@final
class SimulatedRig:
    """An arm that acts in a physics different from the planner's, and cameras that look at it.

    `images`: rings of rendered images by camera: `time_s`, `color` and `depth`. `memory`: shared memory of the arm's
    process, with its own log of states, for measurements of when the arm moved.
    """

    def __init__(
        self,
        arm: ProcessArm,
        shape: ArmShape,
        cameras: Sequence[SimulatedCamera],
        images: Mapping[str, Ring],
        snapshots: Ring,
        memory: ArmMemory,
    ) -> None:
        self._arm, self._shape, self._cameras, self._snapshots = arm, shape, cameras, snapshots
        self.images, self.memory = images, memory

    @property
    def name(self) -> str:
        """Name for the log and the console."""
        return "simulated"

    @property
    def simulated(self) -> bool:
        """True: nothing real can move."""
        return True

    @property
    def shape(self) -> ArmShape:
        """Geometry of the drawn arm."""
        return self._shape

    @property
    def seen_arm(self) -> Arm:
        """The arm in the images, which is `arm`."""
        return self._arm

    @property
    def cameras(self) -> Sequence[Camera]:
        """Views from around the table."""
        return self._cameras

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self._arm

    def truth(self) -> Snapshot:
        """Ground truth of the world, dated in monotonic time, for evaluation."""
        snapshot = newest_snapshot(self._snapshots)
        assert snapshot is not None, "an opened rig has reported its world"
        return snapshot


def simulated_rig(
    *,
    stage: Stage,
    start: Nodes,
    site: Site,
    seed: int,
    cameras: tuple[CameraModel, ...] | None = None,
    depth_views: Mapping[str, CameraModel] | None = None,
    held: HeldBoard | None = None,
    take: Controlled | None = None,
) -> AbstractAsyncContextManager[SimulatedRig]:
    """A rig with the stage's object at `start (K, 3)` [m]; `seed` is that of the cameras' noise.

    `depth_views`: models of the depth cameras, by camera, of the size of its colour; the caller aligns the two from the
    rig's `images`, and reads no frames of such a camera here. `held`: a board in the gripper, to calibrate cameras by.
    `take`: connects to another arm than the simulated one, whose tool is then the world's. Raises DeviceError on entry
    where a process does not start. All processes have ended on leaving, and end by themselves when the application is
    killed.
    """
    scene = _Scene(
        stage=stage,
        start=start,
        cameras=cameras or table_cameras(),
        depth_views=depth_views or {},
        take=take or partial(ArmControl, tool=kind_of(stage).home(stage, start)),
        seed=seed,
        held=held,
    )
    return _open_rig(scene, site)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Scene:
    """Definition of the simulated scene."""

    stage: Stage
    start: Nodes
    cameras: tuple[CameraModel, ...]
    depth_views: Mapping[str, CameraModel]
    take: Controlled
    seed: int
    held: HeldBoard | None


@final
class _Processes:
    """The rig's processes and their memory shared with the application. Construction and `end` block."""

    def __init__(self, scene: _Scene, site: Site) -> None:
        timing, parent = site.timing, os.getpid()
        self.memory, self.snapshots = ArmMemory(), snapshot_ring(scene.stage)
        self.images = {
            camera.name: image_ring(camera.width, camera.height, kept=_IMAGES_KEPT) for camera in scene.cameras
        }
        self.arm = process("arm", run_arm, self.memory, site, scene.take, parent)
        self.world = process(
            "world",
            run_world,
            *(self.memory, self.snapshots, scene.stage, scene.start, timing.arm_period_s, parent),
        )
        self.eyes = process(
            "cameras",
            run_cameras,
            *(self.memory, self.snapshots, self.images, scene.cameras, scene.depth_views, scene.stage),
            *(timing.camera_period_s, scene.seed, parent, scene.held),
        )
        self.all = (self.arm, self.world, self.eyes)

    def start(self) -> None:
        """Start every process."""
        for each in self.all:
            each.start()

    def end(self) -> None:
        """Tell the processes to close and wait for them; kill those that do not."""
        self.memory.closing.value = 1
        end(self.all)

    @property
    def rings(self) -> Sequence[Ring]:
        """Rings that each have a record once everything is up."""
        return (self.memory.states, self.snapshots, *self.images.values())


@asynccontextmanager
async def _open_rig(scene: _Scene, site: Site) -> AsyncGenerator[SimulatedRig]:
    processes = await to_thread.run_sync(_Processes, scene, site)
    try:
        await to_thread.run_sync(processes.start)
        await ready(processes.all, processes.rings)
        cameras = [
            SimulatedCamera(model, processes.images[model.name], processes.eyes, processes.world, site.timing)
            for model in scene.cameras
        ]
        arm = ProcessArm(processes.memory, processes.arm, site)
        shape, memory = known_arm(scene.stage.tool), processes.memory
        yield SimulatedRig(arm, shape, cameras, processes.images, processes.snapshots, memory)
    finally:
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(processes.end)
