"""The board on paper: every corner where it should be, to a twentieth of a millimetre, in all three formats."""

import io
import re

import numpy as np
import pytest
from PIL import Image

from app.core.geometry.charuco import Charuco
from app.core.geometry.lens import Lens
from app.perception.calibration.sheet import DPI, sheet, size_m
from app.perception.calibration.sight import sight

BOARD = Charuco(columns=5, rows=4, square_m=0.02, marker_m=0.015, dictionary="5x5")
INCH_M = 0.0254


def test_the_picture_has_every_corner_at_its_distance_on_paper():
    with Image.open(io.BytesIO(sheet(BOARD, "png"))) as picture:
        assert picture.info["dpi"] == pytest.approx((DPI, DPI), rel=1e-3)
        small = np.asarray(picture.convert("RGB").reduce(4))
    height, width = small.shape[:2]
    lens = Lens(width=width, height=height, K=np.array([[800.0, 0, width / 2], [0, 800.0, height / 2], [0, 0, 1.0]]))
    found = sight(small, BOARD, lens)
    assert len(found.ids) == BOARD.corner_count
    on_paper = found.pixels * 4 / DPI * INCH_M
    expected = found.points(BOARD)[:, :2]
    np.testing.assert_allclose(on_paper - on_paper[0], expected - expected[0], atol=5e-5)


@pytest.mark.parametrize("kind", ["svg", "pdf"])
def test_a_drawing_is_as_large_as_it_says_and_the_same_every_time(kind):
    drawn = sheet(BOARD, kind)
    assert drawn == sheet(BOARD, kind)
    where = rb'width="([\d.]+)pt"' if kind == "svg" else rb"/MediaBox \[ ?0 0 ([\d.]+) "
    said = re.search(where, drawn)
    assert said is not None
    assert float(said[1]) / 72 * INCH_M == pytest.approx(size_m(BOARD)[0], abs=1e-5)
