"""Segmenters from the command line: a file that crashes its reader is refused like any other."""

from pathlib import Path

import pytest

from app.commands._sight import load_tried_segmenter, seen_with
from app.core.errors import UsageError
from app.perception.mask.learned import Learned
from app.tasks import load
from tests.perception.onnx_model import convolution

RED = ((0.0, 0.0, 0.0), (3.0, -3.0, 0.0)), (0.0, -0.6)


@pytest.mark.serial
def test_a_network_that_crashes_its_reader_is_refused_in_words(tmp_path: Path) -> None:
    path = convolution(tmp_path / "red.onnx", *RED)
    path.write_bytes(path.read_bytes().replace(b"weight", b"weiBht", 1))
    with pytest.raises(UsageError, match=r"is damaged: OpenCV, which runs it, crashed with SIG.*export it again"):
        load_tried_segmenter(path, 1)


@pytest.mark.serial
def test_a_network_that_is_right_is_the_tasks_eye(tmp_path: Path) -> None:
    task = seen_with(load("rope_push"), convolution(tmp_path / "red.onnx", *RED), depth=True)
    assert isinstance(task.perception.segmenter, Learned)
