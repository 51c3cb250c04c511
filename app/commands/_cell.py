"""The cell that `run` and `console` open: arm, world and cameras, and the console beside them."""

from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack, asynccontextmanager

from anyio import to_thread

from app import cells
from app.cells.base import Cell, Wanted
from app.core.ports import Rig
from app.teleop import Pilot
from app.ui.console import Console, open_console
from app.ui.server.page import Cell as Behind
from app.ui.server.tls import Tls
from app.ui.terminal import Output


@asynccontextmanager
async def cell(
    name: str, wanted: Wanted, tls: Tls | None, title: str, output: Output
) -> AsyncGenerator[tuple[Rig, Console]]:
    """The rig of that name and its console. The terminal announces their start: it takes seconds."""
    site = wanted.site
    async with AsyncExitStack() as opened:
        with output.status("starting the cell"):
            chosen = await to_thread.run_sync(cells.load, name)
            rig = await opened.enter_async_context(chosen.open(wanted))
            console = await opened.enter_async_context(
                open_console(
                    host=site.console_host,
                    port=site.console_port,
                    title=title,
                    cell=_behind(chosen, rig),
                    stop=rig.arm.stop,
                    limits=site.limits,
                    table=site.table,
                    stage=wanted.stage,
                    tls=tls,
                    hand=Pilot(jog=rig.arm.jog, tool=rig.arm.tool, limits=site.limits),
                    timing=site.timing,
                )
            )
        yield rig, console


def _behind(cell: Cell, rig: Rig) -> Behind:
    """Kind of cell that the console's banner names."""
    if not rig.simulated:
        return "real"
    return "simulated" if cell.answers else "replayed"
