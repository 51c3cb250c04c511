"""The safeguards of the tests themselves are on: shapes are checked, and a blocked event loop is noticed."""

import numpy as np
import pytest
from anyio import to_thread
from blockbuster import BlockingError
from jaxtyping import TypeCheckError

from app.__main__ import command_names
from app.core.motion import Motion


def test_a_wrong_shape_is_noticed():
    with pytest.raises(TypeCheckError, match="positions"):
        Motion(positions=np.zeros((3, 2)), speeds=np.zeros(3))


def test_axes_that_should_agree_and_do_not_are_noticed():
    with pytest.raises(TypeCheckError, match="speeds"):
        Motion(positions=np.zeros((3, 3)), speeds=np.zeros(2))


def test_a_wrong_number_type_is_noticed():
    with pytest.raises(TypeCheckError, match="speeds"):
        Motion(positions=np.zeros((3, 3)), speeds=np.zeros(3, np.float32))


@pytest.mark.anyio
async def test_a_call_that_blocks_the_loop_is_noticed_and_one_in_a_thread_is_not():
    with pytest.raises(BlockingError):
        command_names()  # Lists a folder.
    assert "doctor" in await to_thread.run_sync(command_names)


def test_without_a_loop_nothing_is_watched():
    assert "doctor" in command_names()
