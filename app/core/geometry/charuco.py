"""A ChArUco board as data: a chessboard whose white squares carry markers, so that each of its corners has a number."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from jaxtyping import Float64

from app.core.bounds import check_range
from app.core.errors import ParameterError, UsageError

DICTIONARIES: Final = {"4x4": 4, "5x5": 5, "6x6": 6}
"""Marker families of OpenCV that are offered, with the number of cells along a marker's side."""
MARKERS: Final = 50
"""Markers in the smallest dictionary of each family: the fewer, the more reliably they are told apart."""
_FEWEST, _MOST = 3, 14
_LEAST_BORDER: Final = 0.1
"""White border on either side of a marker, as a share of the square; detection needs it."""


@final
@dataclass(frozen=True, kw_only=True)
class Charuco:
    """`columns` x `rows` squares of `square_m`, with markers of `marker_m`, of a family of markers, on white ones.

    Its frame is OpenCV's: origin at the outer corner of the first square, x along the columns, y along the rows, z into
    the board. The defaults fit one sheet of A4.
    """

    columns: int = 7
    """squares across"""
    rows: int = 5
    """squares down"""
    square_m: float = 0.036
    """side of a square [m]"""
    marker_m: float = 0.024
    """side of a marker [m]"""
    dictionary: str = "4x4"
    """the family of markers: 4x4, 5x5 or 6x6"""

    def __post_init__(self) -> None:
        """Raises ParameterError or UsageError where the sizes make no board."""
        if self.dictionary not in DICTIONARIES:
            raise UsageError.unknown("dictionary of markers", self.dictionary, DICTIONARIES)
        check_range("columns", float(self.columns), float(_FEWEST), float(_MOST))
        check_range("rows", float(self.rows), float(_FEWEST), float(_MOST))
        check_range("square_m", self.square_m, 0.005, 0.5)
        check_range("marker_m", self.marker_m, 0.2 * self.square_m, (1 - 2 * _LEAST_BORDER) * self.square_m)
        if self.columns * self.rows // 2 > MARKERS:
            raise ParameterError(
                f"{self.columns} x {self.rows} squares need {self.columns * self.rows // 2} markers; a dictionary has "
                f"{MARKERS}: use fewer squares."
            )

    @property
    def size_m(self) -> tuple[float, float]:
        """Its width and height [m]."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def corner_count(self) -> int:
        """Number of inner corners."""
        return (self.columns - 1) * (self.rows - 1)

    def corners(self) -> Float64[np.ndarray, "C 3"]:
        """Position of every inner corner [m], shape (C, 3), in the board's frame, by number."""
        x, y = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) * self.square_m

    def outline(self) -> Float64[np.ndarray, "4 3"]:
        """Its four outer corners [m], shape (4, 3), in the board's frame, in order around it."""
        width, height = self.size_m
        return np.array([[0.0, 0.0, 0.0], [width, 0.0, 0.0], [width, height, 0.0], [0.0, height, 0.0]])

    def __str__(self) -> str:
        """Description of the board for messages and for the printed sheet."""
        return (
            f"{self.columns} x {self.rows} squares of {self.square_m * 1e3:g} mm, markers {self.dictionary} of "
            f"{self.marker_m * 1e3:g} mm"
        )
