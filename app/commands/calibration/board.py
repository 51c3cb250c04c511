"""Make a ChArUco board to print at true scale: PDF, SVG or PNG.

Example: dipac calibration board -o board.pdf
"""

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.commands._preflight import check_writable
from app.core.errors import UsageError
from app.core.geometry.charuco import Charuco
from app.perception.calibration.sheet import FORMATS, sheet, size_m

_A4 = Charuco()


def board(
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the file to write: .pdf, .svg or .png")] = Path(
        "board.pdf"
    ),
    board: Charuco = _A4,
) -> None:
    """Print it at 100 %, measure the ruler below it, and fix it flat on something stiff."""
    kind = FORMATS.get(output.suffix.lower())
    if kind is None:
        raise UsageError(f"{output} must end in {', '.join(FORMATS)}; that says what is written.")
    check_writable(output, "-o")
    width, height = size_m(board)
    output.write_bytes(sheet(board, kind))
    Console(highlight=False, soft_wrap=True).print(
        f"{output}: {board}, on {1e3 * width:.0f} x {1e3 * height:.0f} mm. Print it at 100 %, measure the ruler, and "
        "give the same numbers to `dipac calibration check` and `solve`."
    )
