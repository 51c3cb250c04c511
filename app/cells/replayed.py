"""A recording as a cell: its cameras replay their images, and a simulated arm executes the commands.

The images do not respond to the arm's motions: for trying a goal, a model, a segmenter or a planner on real images,
where nothing can move.
"""

import json
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

from anyio import to_thread

from app import cells
from app.cells.base import Cell, OpenedRig, Wanted
from app.config import Site
from app.core.errors import RecordingError, UsageError
from app.core.geometry.arm_geometry import ArmShape
from app.core.geometry.shapes.tools import Tool
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.messages import ArmState, Episode
from app.recording.read.film import Film, film_states, read_film
from app.recording.read.reader import read_episode
from app.rig.replayed.cameras import replayed_cameras
from app.rig.replayed.recorded_arm import RecordedArm
from app.rig.simulated.arm import simulated_arm

_NEEDED: Final = (
    "--rig replayed needs --cell RECORDING.mcap, whose cameras' images it shows; `dipac recordings list` names those "
    "there are."
)


def _narrow_site(site: Site, file: Path | None) -> Site:
    """The site as it is. Raises UsageError where the file is not a replayable recording."""
    _film(file)
    return site


@asynccontextmanager
async def _open_cell(wanted: Wanted) -> AsyncGenerator[OpenedRig]:
    """Open the cell. Raises UsageError where the file cannot be replayed, DeviceError where the arm does not start."""
    if wanted.board:
        raise UsageError("--board puts one into the simulated gripper, and no recorded image shows that; leave it out.")
    film = await to_thread.run_sync(_film, wanted.file)
    states = await to_thread.run_sync(film_states, film)
    shape = await to_thread.run_sync(_arm_shape, film, wanted.stage.tool, states)
    async with (
        simulated_arm(wanted.stage, wanted.start, wanted.site) as arm,
        replayed_cameras(film, wanted.site.timing) as screen,
    ):
        seen = RecordedArm(states, screen.recorded_s) if states else arm
        yield OpenedRig(name="replayed", simulated=True, shape=shape, seen_arm=seen, cameras=screen.cameras, arm=arm)


def _arm_shape(film: Film, tool: Tool, states: Sequence[ArmState]) -> ArmShape | None:
    """Geometry of the arm in the images; None where that or its configuration is unknown.

    A recording of a replay shows an arm other than that of its states, so the replayed cell gives no geometry.
    """
    episode = read_episode(film.path)
    looks = cells.load(episode.rig).pictured if episode.rig in cells.names() else None
    return looks(tool, states[0], _table(episode)) if looks and states else None


def _table(episode: Episode) -> TablePlace:
    """Pose of the table in the recording; where it has none, the arm stood on the table.

    Raises UsageError where it is not a pose.
    """
    try:
        config = json.loads(episode.config)
    except ValueError:
        return AT_BASE
    if not isinstance(config, dict) or "table" not in config:
        return AT_BASE
    said: Any = config["table"]
    try:
        x, y, z = (float(each) for each in said["place_m"])
        return TablePlace(place_m=(x, y, z), turn_deg=float(said["turn_deg"]))
    except (ValueError, KeyError, TypeError):
        raise UsageError(
            f"--rig replayed cannot show it: the recording says that its table is at {said!r}, and needs place_m = "
            "[x, y, z] and turn_deg; choose another recording."
        ) from None


def _film(file: Path | None) -> Film:
    """The recording's images. Raises UsageError, with the reason, where they are insufficient."""
    if file is None:
        raise UsageError(_NEEDED)
    try:
        film = read_film(file)
    except RecordingError as error:
        raise UsageError(f"--rig replayed cannot show it: {error}") from None
    if len(film.cameras) < 2:
        raise UsageError(
            f"{file} has one camera, {next(iter(film.cameras))!r}, and one alone does not see around an object; choose "
            "a recording of two cameras or more."
        )
    return film


CELL: Final = Cell(name="replayed", simulated=True, answers=False, open=_open_cell, narrowed=_narrow_site)
