"""Find where a camera stands, from images of a board.

Of each image the pose of the gripper is given.

Example: dipac calibration solve IMAGES --setup wrist
"""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands._arguments import FolderArgument
from app.commands._preflight import check_writable
from app.commands.calibration._session import POSES, read_poses, read_session
from app.config import Site
from app.core.errors import PerceptionError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import HandEye, Setup
from app.perception.calibration.next_pose import HandEyeSetup, next_pose
from app.perception.calibration.pose_mistakes import likely_mistake
from app.perception.calibration.se3 import angle, inverse
from app.perception.calibration.solve import CalibrationView, Solved, ends_of
from app.perception.calibration.solve import solve as solved
from app.recording.exchange.calibration_file import FILE, known_cameras, save_camera

_A4 = Charuco()
_MM = 1e3


def solve(
    folder: FolderArgument,
    /,
    *,
    setup: Setup = "fixed",
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = FILE,
    board: Charuco = _A4,
) -> None:
    """Take 15 to 25 views with the arm at rest, the gripper tilted to all sides.

    Args:
        folder: images, camera.toml with the serial number and the intrinsics, and poses.csv.
        setup: fixed: the camera stands and the gripper holds the board; wrist: the other way round.
        output: the calibration file; other cameras that are in it stay.
        board: the printed board.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    check_writable(output, "-o")
    before = known_cameras(output)
    poses = read_poses(folder / POSES)
    session = read_session(terminal, folder, board, list(poses))
    views = [CalibrationView(sight=each, T_world_gripper=poses[name]) for name, each in session.sights.items()]
    if not views:
        raise UsageError(f"The board is in none of the images of {folder}; check that it is the one that was printed.")
    today = datetime.now(UTC).date()

    def calibrated(given: Sequence[CalibrationView]) -> Solved:
        return solved(given, setup, session.lens, board, serial=session.serial, calibrated_at=today)

    try:
        found = calibrated(views)
    except PerceptionError as error:
        mistake = likely_mistake(views, calibrated)
        raise PerceptionError(f"The poses fit if {mistake}. As they are: {error}" if mistake else str(error)) from None
    terminal.print(_views(found, list(session.sights)))
    for line in _result_lines(found.found):
        terminal.print(line)
    if session.serial in before:
        terminal.print(_difference(before[session.serial], found.found))
    terminal.print(_advice(found.found, views))
    save_camera(output, found.found)
    terminal.print(f"Written to {output}, as camera {session.serial!r}.")


def _result_lines(found: HandEye) -> list[str]:
    """The result, line by line."""
    x, y, z = _MM * found.pose[:3, 3]
    shifts, turns = (", ".join(f"{each:.2f}" for each in values) for values in (_mm(found), found.deviation_deg))
    spread = ", ".join(f"{each:.0f}" for each in found.spread.turns_deg)
    return [
        f"The camera is at x {x:.1f}, y {y:.1f}, z {z:.1f} mm. Standard deviations: {shifts} mm, {turns} degrees.",
        f"{found.views} views miss it by {found.error_px:.2f} pixels, {_MM * found.error_m:.2f} mm, "
        f"{found.error_deg:.2f} degrees; {found.outliers} were left out. They are spread by {spread} degrees.",
    ]


def _mm(found: HandEye) -> list[float]:
    return [_MM * each for each in found.deviation_m]


def _views(found: Solved, names: list[str]) -> Table:
    table = Table("view", "pixel", "mm", "degree", "", box=None)
    rows = zip(names, found.refined.error_px, found.view_error_m, found.view_error_deg, strict=True)
    for index, (name, px, m, deg) in enumerate(rows):
        out = index in found.outliers
        style, word = ("yellow", "left out") if out else ("", "")
        table.add_row(*(Text(each) for each in (name, f"{px:.2f}", f"{_MM * m:.2f}", f"{deg:.2f}", word)), style=style)
    return table


def _difference(before: HandEye, now: HandEye) -> str:
    if before.setup != now.setup:
        return f"Before, it was calibrated as one of the other set-up ({before.setup})."
    moved_mm = _MM * float(np.linalg.norm(now.pose[:3, 3] - before.pose[:3, 3]))
    turned_deg = float(np.degrees(angle((inverse(before.pose) @ now.pose)[:3, :3])))
    return f"Since {before.calibrated_at} it has moved by {moved_mm:.1f} mm and turned by {turned_deg:.2f} degrees."


def _advice(found: HandEye, views: list[CalibrationView]) -> str:
    eye = HandEyeSetup(lens=found.lens, board=found.board, setup=found.setup, ends=ends_of(found))
    best = next_pose(eye, views, Site().limits.workspace, np.random.default_rng(0))
    if best is None:
        return "No other pose in the workspace would show the board whole."
    x, y, z = _MM * best.T_world_gripper[:3, 3]
    return (
        f"One more view would tell most with the gripper at x {x:.0f}, y {y:.0f}, z {z:.0f} mm: "
        f"{_MM * best.promised_m:.2f} mm instead of {_MM * best.deviation_m:.2f}."
    )
