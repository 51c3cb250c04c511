"""Intrinsics compared with views: right ones agree, wrong ones do not, and too little says so."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.errors import PerceptionError
from app.core.geometry.lens import Lens
from app.perception.calibration.intrinsics import check_lens
from app.perception.calibration.sight import sight
from bench.boards import BOARD, LENS, Camera, cell, image


def sights(lens: Lens, told: Lens, views: int = 12, tilt_deg: float = 35.0):
    rng = np.random.default_rng(0)
    return [sight(image(C, Camera(), rng, lens), BOARD, told) for C in cell(0, views, tilt_deg=tilt_deg).C]


def test_right_intrinsics_agree():
    found = check_lens(sights(LENS, LENS), BOARD, LENS)
    assert found.verdict == "agrees"
    assert np.all(np.abs(found.fitted - found.told) < 5 * found.deviation + 0.2)
    assert found.told_px < 0.3


def test_a_wrong_focal_length_differs():
    told = replace(LENS, K=np.array([[620.0, 0.0, 319.5], [0.0, 618.0, 239.5], [0.0, 0.0, 1.0]]))
    found = check_lens(sights(LENS, told), BOARD, told)
    assert found.verdict == "differs"
    np.testing.assert_allclose(found.fitted[:2], [605, 603], atol=3)


def test_a_lens_that_nobody_told_of_is_noticed_and_one_that_is_told_of_agrees():
    bent = replace(LENS, distortion=(-0.12, 0.05, 0.0, 0.0, 0.0))
    unsaid = check_lens(sights(bent, LENS), BOARD, LENS)
    assert unsaid.verdict == "differs"
    assert "bent" in str(unsaid)
    assert check_lens(sights(bent, bent), BOARD, bent).verdict == "agrees"


def test_too_few_views_and_views_too_much_alike_are_refused():
    with pytest.raises(PerceptionError, match="6 are needed"):
        check_lens(sights(LENS, LENS, views=5), BOARD, LENS)
    with pytest.raises(PerceptionError, match="tilt it"):
        check_lens(sights(LENS, LENS, views=6, tilt_deg=4.0), BOARD, LENS)
