"""Goals of files that a browser sent: read where they make sense, refused in one line where they do not."""

import io

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from app.core.errors import UsageError
from app.ui.goals.files import are_points, pictures_of, points_of

POINTS = np.random.default_rng(0).uniform(0.3, 0.6, (50, 3)).astype(np.float32)


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=False)
    return stream.getvalue()


def picture(array: np.ndarray, kind: str = "PNG") -> bytes:
    stream = io.BytesIO()
    Image.fromarray(array).save(stream, kind)
    return stream.getvalue()


COLOR = np.random.default_rng(1).integers(0, 255, (48, 64, 3), dtype=np.uint8)
DEPTH = np.random.default_rng(1).integers(300, 1200, (48, 64), dtype=np.uint16)


@pytest.mark.parametrize("name", ["goal.npy", "GOAL.NPY"])
def test_an_array_of_points_is_read_exactly(name: str) -> None:
    files = {name: npy(POINTS)}
    assert are_points(files)
    np.testing.assert_array_equal(points_of(files), POINTS)


def test_of_very_many_points_every_few_are_enough() -> None:
    many = np.tile(POINTS, (5001, 1))
    read = points_of({"goal.npy": npy(many)})
    assert 80_000 < len(read) <= 100_000
    assert {tuple(point) for point in read} == {tuple(point) for point in POINTS}


def test_a_cloud_is_read_exactly() -> None:
    cloud = trimesh.PointCloud(POINTS).export(file_type="ply")
    np.testing.assert_allclose(points_of({"goal.ply": cloud}), POINTS, atol=1e-6)


@pytest.mark.parametrize("depth_first", [True, False])
def test_a_pair_of_pictures_is_told_apart_by_what_is_in_it(depth_first: bool) -> None:
    pair = [("a.png", picture(COLOR)), ("b.png", picture(DEPTH))]
    files = dict(pair[::-1] if depth_first else pair)
    assert not are_points(files)
    color, depth = pictures_of(files)
    np.testing.assert_array_equal(color, COLOR)
    np.testing.assert_array_equal(depth, DEPTH)


def test_colours_may_come_as_jpeg() -> None:
    color, _ = pictures_of({"c.jpg": picture(COLOR, "JPEG"), "d.png": picture(DEPTH)})
    assert color.shape == COLOR.shape


@pytest.mark.parametrize("names", [[], ["a.txt"], ["a.npy", "b.npy"], ["a.png"], ["a.png", "b.npy"], ["a"]])
def test_other_files_are_refused_with_what_to_give(names: list[str]) -> None:
    with pytest.raises(UsageError, match=r"give one .npy, .npz or .ply"):
        are_points(dict.fromkeys(names, b""))


@pytest.mark.parametrize("array", [np.zeros((4, 2)), np.zeros(3), np.zeros((0, 3)), np.full((2, 3), "x")])
def test_an_array_of_something_else_is_refused(array: np.ndarray) -> None:
    with pytest.raises(UsageError, match="points"):
        points_of({"goal.npy": npy(array)})


def test_a_file_that_says_more_than_it_holds_takes_no_memory() -> None:
    stream = io.BytesIO()
    told = {"descr": "<f4", "fortran_order": False, "shape": (5 * 10**12, 3)}
    np.lib.format.write_array_header_1_0(stream, told)
    with pytest.raises(UsageError, match="shorter than it says"):
        points_of({"goal.npy": stream.getvalue()})


@given(st.binary(max_size=400), st.sampled_from(["a.npy", "a.ply"]))
def test_nonsense_is_refused(data: bytes, name: str) -> None:
    head = {"a.npy": b"\x93NUMPY\x01\x00", "a.ply": b"ply\nformat ascii 1.0\n"}[name]
    for content in (data, head + data):
        with pytest.raises(UsageError):
            points_of({name: content})


@given(st.binary(max_size=400))
def test_pictures_of_nonsense_are_refused(data: bytes) -> None:
    for files in ({"a.png": data, "b.png": data}, {"a.png": picture(COLOR), "b.png": picture(DEPTH)[: 60 + len(data)]}):
        with pytest.raises(UsageError):
            pictures_of(files)


def test_two_pictures_of_a_kind_and_a_gigantic_one_are_refused() -> None:
    with pytest.raises(UsageError, match="16-bit depth"):
        pictures_of({"a.png": picture(COLOR), "b.png": picture(COLOR)})
    wide = bytearray(picture(DEPTH))
    wide[16:24] = (60_000).to_bytes(4, "big") * 2
    with pytest.raises(UsageError):
        pictures_of({"a.png": picture(COLOR), "b.png": bytes(wide)})
