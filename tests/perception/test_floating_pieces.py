"""Pieces are told from the liquid that they swim in."""

import numpy as np
import pytest

from app.core.colours import ColourRange
from app.perception.body.floating_pieces import Swimming

HOW = Swimming(colours=(ColourRange.around((0.9, 0.8, 0.2)),), share=0.2, below_m=0.008)
BODY = np.random.default_rng(0).uniform(0, [0.08, 0.08, 0.03], (4000, 3)).astype(np.float32)


@pytest.mark.parametrize("count", [1, 10, 300, 2001])
def test_the_parts_are_the_whole(count: int) -> None:
    liquid, solid = HOW.split(count)
    assert liquid + solid == count
    assert solid == pytest.approx(0.2 * count, abs=0.51)


def test_pieces_are_under_their_tops() -> None:
    top = np.array([[0.02, 0.02, 0.03]], np.float32)
    liquid, solid = HOW.apart(BODY, top)
    assert len(liquid) + len(solid) == len(BODY)
    assert len(solid) == HOW.split(len(BODY))[1]
    middle = top - [0, 0, 0.008]
    assert np.linalg.norm(solid - middle, axis=1).max() <= np.linalg.norm(liquid - middle, axis=1).min()


def test_pieces_that_nobody_sees_are_anywhere() -> None:
    _, solid = HOW.apart(BODY, np.zeros((0, 3), np.float32))
    np.testing.assert_allclose(solid.mean(axis=0), BODY.mean(axis=0), atol=0.002)
