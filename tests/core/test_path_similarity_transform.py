"""Laws of a way whose ends are moved."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.path_similarity_transform import is_level, reshape

places = st.tuples(*[st.floats(-0.5, 0.5)] * 2).map(lambda xy: np.array([*xy, 0.0]))
s = np.linspace(0.0, 1.0, 12)
ASIDE = np.array([0.1, 0.0, 0.0])
WAY = np.column_stack([0.5 + 0.1 * s, 0.02 * np.sin(3 * s), np.full(12, 0.006)])


@given(places, places)
def test_it_begins_and_ends_where_it_was_moved_to_at_its_own_height(start: np.ndarray, end: np.ndarray) -> None:
    made = reshape(WAY, start, end)
    np.testing.assert_allclose(made[[0, -1], :2], [start[:2], end[:2]], atol=1e-12)
    np.testing.assert_array_equal(made[:, 2], WAY[:, 2])


@given(places, places)
def test_its_form_stays(start: np.ndarray, end: np.ndarray) -> None:
    made = reshape(WAY, start, end)
    scale = np.linalg.norm((end - start)[:2]) / np.linalg.norm((WAY[-1] - WAY[0])[:2])
    lengths = [np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1) for way in (WAY, made)]
    np.testing.assert_allclose(lengths[1], scale * lengths[0], atol=1e-12)


def test_ends_that_stay_leave_it_as_it_is() -> None:
    np.testing.assert_allclose(reshape(WAY, WAY[0], WAY[-1]), WAY, atol=1e-15)


def test_a_way_that_ends_where_it_begins_follows_its_start() -> None:
    loop = np.concatenate([WAY, WAY[::-1]])
    np.testing.assert_allclose(reshape(loop, loop[0] + ASIDE, loop[-1]), loop + ASIDE, atol=1e-15)


@pytest.mark.parametrize(
    ("way", "level"),
    [
        (WAY, True),
        (WAY[:1], False),
        (WAY[:0], False),
        (WAY * np.nan, False),
        (np.repeat(WAY[:1], 5, axis=0), False),
        (WAY + np.outer(s, [0, 0, 0.1]), False),
    ],
)
def test_a_push_is_at_one_height_and_goes_somewhere(way: np.ndarray, level: bool) -> None:
    assert is_level(way) is level
