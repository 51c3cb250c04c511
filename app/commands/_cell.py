"""The cell that `run` and `console` open: arm, world and cameras, and the console beside them."""

from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack, asynccontextmanager

from app.commands._rehearsed import rehearsed_rig
from app.commands._wired import wired_arm
from app.config import Site
from app.core.ports import Rig
from app.rig.simulated.held_board import HeldBoard
from app.rig.simulated.rig import simulated_rig
from app.tasks import Task
from app.teleop import Pilot
from app.ui.console import Console, open_console
from app.ui.terminal import Output
from app.ui.tls import Tls


@asynccontextmanager
async def cell(
    task: Task,
    site: Site,
    output: Output,
    *,
    seed: int,
    tls: Tls | None,
    held: HeldBoard | None,
    realsense: bool,
    kinova: bool,
) -> AsyncGenerator[tuple[Rig, Console]]:
    """The simulated rig and its console. The terminal says that they start: it takes seconds.

    `held`: a board in the gripper; `realsense`: seen through their SDK; `kinova`: the arm over its protocol.
    """
    async with AsyncExitStack() as opened:
        with output.status("starting the cell"):
            take = await opened.enter_async_context(wired_arm()) if kinova else None
            open_rig = rehearsed_rig if realsense else simulated_rig
            rig: Rig = await opened.enter_async_context(
                open_rig(stage=task.stage, start=task.start(seed), site=site, seed=seed, held=held, take=take)
            )
            console = await opened.enter_async_context(
                open_console(
                    host=site.console_host,
                    port=site.console_port,
                    title=f"dipac {task.name}",
                    cell="simulated" if rig.simulated else "real",
                    stop=rig.arm.stop,
                    workspace=site.limits.workspace,
                    tls=tls,
                    hand=Pilot(jog=rig.arm.jog, tool=rig.arm.tool, limits=site.limits),
                    timing=site.timing,
                )
            )
        yield rig, console
