"""A segmenter from an ONNX file: it finds what it was made for, and a file that is none is refused in words."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.colours import ColourRange
from app.core.errors import UsageError
from app.core.geometry.chamfer import chamfer_m2
from app.perception.mask.learned import load_segmenter
from app.perception.reconstruct import Reconstruction, reconstruct
from tests.perception.onnx_model import convolution
from tests.perception.scene import ROPE_RGB, views

HOW = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300)
# The background wins unless red exceeds green by a third of the scale at least.
RED = ((0.0, 0.0, 0.0), (3.0, -3.0, 0.0)), (0.0, -0.6)
BLUE = (*RED[0], (-3.0, 0.0, 3.0)), (*RED[1], -0.6)


def picture() -> np.ndarray:
    """Grey, with a red square at the top left and a blue one at the bottom right."""
    color = np.full((480, 640, 3), 120, np.uint8)
    color[40:120, 80:200], color[300:400, 400:600] = (220, 30, 30), (30, 30, 220)
    return color


@pytest.mark.parametrize("size", [None, (480, 640), (240, 320)], ids=str)
def test_a_network_of_open_or_fixed_size_finds_its_object_in_the_image(tmp_path: Path, size):
    (mask,) = load_segmenter(convolution(tmp_path / "red.onnx", *RED, size=size), 1).masks(picture())
    assert mask.shape == (480, 640)
    assert mask[40:120, 80:200].mean() > 0.97
    assert mask.sum() < 1.03 * 80 * 120


def test_a_network_of_two_objects_gives_a_mask_each(tmp_path: Path):
    red, blue = load_segmenter(convolution(tmp_path / "two.onnx", *BLUE), 2).masks(picture())
    assert red[80, 140]
    assert blue[350, 500]
    assert not (red & blue).any()


def test_the_object_is_reconstructed_with_it_as_by_colour(tmp_path: Path, tube):
    segmenter = load_segmenter(convolution(tmp_path / "red.onnx", *RED), 1)
    frames = views(tube)
    learned, coloured = (reconstruct(frames, how).positions for how in (replace(HOW, segmenter=segmenter), HOW))
    assert float(np.sqrt(chamfer_m2(learned, coloured) / 2)) < 0.004


def test_it_travels_to_another_process(tmp_path: Path):
    segmenter = load_segmenter(convolution(tmp_path / "red.onnx", *RED), 1)
    assert pickle.loads(pickle.dumps(segmenter)) == segmenter


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"channels": 1}, r"\(1, 1, \?, \?\) in.*has one input of 32-bit floats, shape \(1, 3, H, W\)"),
        ({"kind": 11}, r"of another type than 32-bit floats.*has one input"),
    ],
    ids=["grey", "doubles"],
)
def test_another_input_is_refused_with_what_is_there_and_what_is_wanted(tmp_path: Path, change, says):
    weights = [[1.0] * change.get("channels", 3)] * 2
    path = convolution(tmp_path / "other.onnx", weights, (0.0, 0.0), **change)
    with pytest.raises(UsageError, match=says):
        load_segmenter(path, 1)


def test_another_number_of_classes_is_refused(tmp_path: Path):
    path = convolution(tmp_path / "two.onnx", *BLUE)
    with pytest.raises(UsageError, match=r"output of shape \(1, 3, 96, 128\).*\(1, 2, h, w\).*background and of one"):
        load_segmenter(path, 1)


@pytest.mark.parametrize("data", [b"", b"no network at all", b"\x3a\x7f cut off", bytes(range(256))], ids=repr)
def test_what_is_no_network_is_refused(tmp_path: Path, data: bytes):
    path = tmp_path / "none.onnx"
    path.write_bytes(data)
    with pytest.raises(UsageError, match=r"none\.onnx (is no ONNX file|has nothing in|cannot be run)"):
        load_segmenter(path, 1)


def test_a_file_that_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(UsageError, match=r"missing\.onnx cannot be read: No such file"):
        load_segmenter(tmp_path / "missing.onnx", 1)


@pytest.mark.parametrize("spoilt", ["weights", "bias"])
def test_a_network_whose_training_diverged_is_refused(tmp_path: Path, spoilt: str):
    (background, weights), bias = RED
    rows = (background, tuple(np.nan * each for each in weights)) if spoilt == "weights" else (background, weights)
    offsets = (np.inf, bias[1]) if spoilt == "bias" else bias
    with pytest.raises(UsageError, match="diverged"):
        load_segmenter(convolution(tmp_path / "nan.onnx", rows, offsets), 1)
