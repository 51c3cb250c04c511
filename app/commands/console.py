"""Work in the browser, in a simulated, recorded or real cell.

Motions wait for approval, or the mode says more.

Example: dipac console bean_sweep
"""

from pathlib import Path
from typing import Annotated

import anyio
import tyro
from rich.text import Text

from app.commands._arguments import TaskArgument
from app.commands._episode import RunOptions, episode
from app.commands._options import Options
from app.ui.terminal import Output


def console(
    task: TaskArgument = "rope_push",
    /,
    *,
    options: Annotated[Options, tyro.conf.arg(name="")] = Options(),
    case: Annotated[
        Path | None,
        tyro.conf.arg(
            help="a folder of `dipac discover`: its verdict is shown, its model used (where --model names no other), "
            "and the push that it asks for offered first"
        ),
    ] = None,
    board: Annotated[
        bool, tyro.conf.arg(help="the simulated gripper holds a ChArUco board, to try the calibration of cameras")
    ] = False,
    allow_automatic: Annotated[
        bool,
        tyro.conf.arg(
            help="on a real arm, too, motions may be made without approval, once whoever has control asks for so many "
            "and confirms it"
        ),
    ] = False,
    resume: Annotated[
        Path | None,
        tyro.conf.arg(
            help="a recording, or a folder of demonstrations, to go on from: the session begins if cell, cameras, task "
            "and object are the same, or says what differs"
        ),
    ] = None,
) -> None:
    """Serve the console at the printed address until somebody ends the session there, or Ctrl-C.

    Where the goal is reached, or --pushes motions are made, it waits for another goal or mode.
    """
    output = Output()
    order = RunOptions(
        asked=task,
        options=options,
        automatic=False,
        case=case,
        board=board,
        allow_automatic=allow_automatic,
        resume=resume,
    )
    report = anyio.run(episode, order, output)
    output.print(Text(f"Recording: {report.recording}"), soft_wrap=True)
    if report.failure is not None:
        raise report.failure
