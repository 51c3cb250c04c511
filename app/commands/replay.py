"""Look at a recording again, or at a simulation that failed.

In the console, at any speed, planned again from any moment.

Example: dipac replay recordings/FILE.mcap --speed 2
"""

from functools import partial
from pathlib import Path
from typing import Annotated, Final

import anyio
import tyro

from app.commands._arguments import FileArgument
from app.core.errors import ParameterError, UsageError
from app.ui.terminal import Output

_PORT: Final = 8088


def replay(
    file: Annotated[FileArgument, tyro.conf.arg(metavar="FILE", help="a recording, or the .npz that a failure named")],
    /,
    *,
    at: Annotated[float, tyro.conf.arg(help="the moment to begin at [s]")] = 0.0,
    speed: Annotated[float, tyro.conf.arg(help="recorded seconds a second; inf: as fast as it can be read")] = 1.0,
    replan: Annotated[bool, tyro.conf.arg(help="plan that moment again, print the comparison and end")] = False,
    model: Annotated[Path | None, tyro.conf.arg(help="a model.toml to plan again with; else the recorded one")] = None,
    port: Annotated[int, tyro.conf.arg(help="of the console; 0 takes a free one")] = _PORT,
) -> None:
    """Serve a recording (.mcap) at the printed address until Ctrl-C, or replay the dump (.npz) of a failed simulation.

    Nothing moves, and nothing is written into the recording. A dump holds the parameters that failed, and is simulated
    again with exactly those: the options are for recordings.
    """
    if file.suffix != ".mcap":
        if (at, speed, replan, model, port) != (0.0, 1.0, False, None, _PORT):
            raise UsageError(f"{file} is no recording (.mcap); the options of replay are for recordings alone.")
        from app.commands._autopsy import autopsy  # The simulator takes seconds to load, which recordings do not need.

        autopsy(file)
        return
    if not at >= 0:
        raise ParameterError(f"--at = {at:g} must not be negative; it counts from the first message.")
    if not speed > 0:
        raise ParameterError(f"--speed = {speed:g} must be above 0; `inf` is as fast as the recording can be read.")
    from app.commands._player import compare, serve

    output, path = Output(highlight=False), str(model or "")
    if replan:
        anyio.run(partial(compare, file, output, at_s=at, model=path))
    else:
        anyio.run(partial(serve, file, output, at_s=at, speed=speed, model=path, port=port))
