"""A goal from a file becomes as many particles as are planned with; what is wrong with it is said in one line."""

from pathlib import Path

import numpy as np
import pytest

from app.commands._goal import read_goal
from app.config import Workspace
from app.core.errors import UsageError
from app.jobs.goals import goal_of

COUNT = 50


def saved(folder: Path, points: np.ndarray) -> Path:
    path = folder / "goal.npy"
    np.save(path, points)
    return path


def read(path: Path) -> np.ndarray:
    return goal_of("rope_push", read_goal(path), COUNT, Workspace(), f"The goal {path}")


def a_line(count: int) -> np.ndarray:
    return np.stack([np.linspace(0.4, 0.6, count), np.zeros(count), np.full(count, 0.008)], axis=1)


def refusal(path: Path) -> str:
    with pytest.raises(UsageError) as refused:
        read(path)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_as_many_points_as_particles_stay_as_they_are(tmp_path: Path):
    points = a_line(COUNT)
    np.testing.assert_array_equal(read(saved(tmp_path, points)), points.astype(np.float32))


def test_more_points_are_shared_evenly_by_the_particles(tmp_path: Path):
    particles = read(saved(tmp_path, a_line(4000)))
    assert particles.shape == (COUNT, 3)
    gaps = np.diff(np.sort(particles[:, 0]))
    assert gaps.max() < 2 * 0.2 / COUNT
    assert particles[:, 0].min() < 0.405
    assert particles[:, 0].max() > 0.595


def test_fewer_points_are_refused_with_both_numbers(tmp_path: Path):
    said = refusal(saved(tmp_path, a_line(COUNT - 1)))
    assert f"{COUNT - 1} points" in said
    assert f"{COUNT} particles" in said


@pytest.mark.parametrize("content", [b"", b"not an array", b"\x93NUMPY\x01\x00"])
def test_a_file_that_is_no_array_is_refused(content: bytes, tmp_path: Path):
    path = tmp_path / "goal.npy"
    path.write_bytes(content)
    assert "Cannot read the goal" in refusal(path)


def test_a_missing_file_is_refused(tmp_path: Path):
    assert "Cannot read the goal" in refusal(tmp_path / "none.npy")


@pytest.mark.parametrize(
    "points", [np.full((COUNT, 3), "here"), np.zeros((COUNT, 2)), np.zeros(3), np.zeros((COUNT, 3), complex)]
)
def test_an_array_of_something_else_is_refused(points: np.ndarray, tmp_path: Path):
    assert "must be points (M, 3)" in refusal(saved(tmp_path, points))


@pytest.mark.parametrize("outside", [(0.2, 0, 0), (0.5, 0.4, 0), (0.5, 0, -0.01), (0.5, 0, 0.5), (np.nan, 0, 0)])
def test_a_point_outside_the_workspace_is_named(outside: tuple[float, float, float], tmp_path: Path):
    points = a_line(COUNT)
    points[7] = outside
    assert "goal.npy: point 7, " in refusal(saved(tmp_path, points))


def test_noise_of_a_depth_camera_below_the_table_is_put_on_it(tmp_path: Path):
    points = a_line(COUNT)
    points[::7, 2] = -0.0012
    read_back = read(saved(tmp_path, points))
    assert read_back[:, 2].min() == 0
    np.testing.assert_array_equal(read_back[:, :2], points[:, :2].astype(np.float32))
    points[::7, 2] = -0.3
    said = refusal(saved(tmp_path, points))
    assert "is below the table, as 8 of 50 are, by up to 300.0 mm" in said


def test_points_that_are_not_finite_are_called_so(tmp_path: Path):
    points = a_line(COUNT)
    points[7] = np.nan
    assert "point 7, [nan, nan, nan], is not finite, as 1 of 50 are" in refusal(saved(tmp_path, points))


def test_what_is_beyond_single_precision_is_not_finite_and_an_error_is_one_line(tmp_path: Path):
    far = np.array([[0.5, 0.0, 1e300]])
    np.save(tmp_path / "goal.npy", far)
    with pytest.raises(UsageError, match=r"point 0, .* is not finite"):
        read_goal(tmp_path / "goal.npy")
    data = (tmp_path / "goal.npy").read_bytes()
    (tmp_path / "goal.npy").write_bytes(data[:8] + b"\x7f\x7f" + data[10:] + b" " * 40_000)
    with pytest.raises(UsageError, match="Cannot read") as refused:
        read_goal(tmp_path / "goal.npy")
    assert "\n" not in str(refused.value)


def test_a_point_outside_is_not_shown_as_one_inside(tmp_path: Path):
    points = a_line(COUNT)
    points[3, 0] = Workspace().high[0] + 2e-5
    assert "0.85002" in refusal(saved(tmp_path, points))


def test_points_at_one_place_are_no_object(tmp_path: Path):
    assert "one place" in refusal(saved(tmp_path, np.repeat(a_line(COUNT)[:1], COUNT, axis=0)))


@pytest.mark.parametrize("name", ["goal.ply", "goal.npz", "goal.dat"])
def test_a_goal_is_read_from_every_file_of_points(name: str, tmp_path: Path):
    points = a_line(COUNT)
    np.save(tmp_path / "goal.npy", points)
    np.savez(tmp_path / "goal.npz", points=points, weights=np.ones(COUNT))
    (tmp_path / "goal.dat").write_bytes((tmp_path / "goal.npz").read_bytes())
    head = f"ply\nformat ascii 1.0\nelement vertex {COUNT}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    rows = "\n".join(" ".join(map(str, row)) for row in points)
    (tmp_path / "goal.ply").write_text(f"{head}end_header\n{rows}\n")
    np.testing.assert_allclose(read(tmp_path / name), points, atol=1e-6)


def test_an_archive_of_several_arrays_names_them(tmp_path: Path):
    np.savez(tmp_path / "goal.npz", a=a_line(COUNT), b=a_line(COUNT))
    said = refusal(tmp_path / "goal.npz")
    assert "a, b" in said
    assert "`points`" in said
