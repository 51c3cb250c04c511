"""Compare a camera's intrinsics with images of a board.

Example: dipac calibration check IMAGES
"""

from datetime import UTC, datetime
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands._arguments import FolderArgument
from app.commands.calibration._session import read_session
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import LastCheck
from app.perception.calibration.intrinsics import LensCheck, check_lens
from app.recording.exchange.calibration_file import FILE, note_check

_A4 = Charuco()
_NAMES = ("fx", "fy", "cx", "cy")


def check(folder: FolderArgument, /, *, board: Charuco = _A4, kept: Path = FILE) -> None:
    """Take 10 to 20 images of the board, near and far, tilted to all sides, in all corners of the image.

    Args:
        folder: the images, with the maker's intrinsics in camera.toml.
        board: the printed board.
        kept: the calibration file; the result is noted beside the camera's entry, where there is one.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    session = read_session(terminal, folder, board)
    found = check_lens(list(session.sights.values()), board, session.lens)
    terminal.print(_table(found))
    terminal.print(
        f"Error of reprojection: {found.told_px:.2f} pixels with the maker's intrinsics, {found.fitted_px:.2f} with "
        f"those fitted, {found.bent_px:.2f} with distortion beyond the maker's ({found.bend_px:.1f} pixels at most)."
    )
    terminal.print(Text(str(found), "green" if found.verdict == "agrees" else "yellow"))
    noted = LastCheck(day=datetime.now(UTC).date(), verdict=found.verdict, said=str(found))
    if note_check(kept, session.serial, optics=noted):
        terminal.print(f"That is noted beside camera {session.serial!r} in {kept}.")


def _table(found: LensCheck) -> Table:
    table = Table("pixels", "maker", "fitted", "standard error", "difference", box=None)
    for name, told, fitted, deviation in zip(_NAMES, found.told, found.fitted, found.deviation, strict=True):
        table.add_row(name, f"{told:.2f}", f"{fitted:.2f}", f"{deviation:.2f}", f"{fitted - told:+.2f}")
    return table
