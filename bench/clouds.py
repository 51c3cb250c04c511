"""Clouds by Open3D and by NumPy with SciPy, side by side: `python -m bench.clouds`.

Lonely points dropped, which `app.perception` leaves to Open3D; a depth image to points and one point a voxel, which it
does not; on made-up ropes of few and many points. Columns: milliseconds of all processors, and points that are left.
"""

import time
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree

from app.core.system.shared_libraries import load_open3d
from app.core.types import Cloud
from app.perception.cloud.depth import deproject
from app.perception.cloud.fuse import merge, without_outliers
from app.rig.simulated.cameras.cameras import table_cameras

Work: TypeAlias = Callable[[], Cloud]

_REPEATS: Final = 30
_VOXEL_M, _NEIGHBOURS, _SPREAD = 0.0015, 16, 2.0


def milliseconds(work: Work) -> float:
    """The median of some, after one that is not counted."""
    taken = list[float]()
    for _ in range(_REPEATS + 1):
        began_s = time.process_time()
        work()
        taken.append(1e3 * (time.process_time() - began_s))
    return float(np.median(taken[1:]))


def rope(count: int) -> Cloud:
    """Points (count, 3) [m] of a rope with a camera's noise, a hundredth of them anywhere."""
    rng, along = np.random.default_rng(0), np.linspace(0, 1, count)
    points = np.stack([0.5 + 0.1 * np.sin(6 * along), 0.4 * along - 0.2, np.full(count, 0.01)], axis=1)
    points += rng.normal(0, 0.003, points.shape)
    points[::100] += rng.normal(0, 0.05, points[::100].shape)
    return points.astype(np.float32)


def depth_to_cloud(size: int) -> tuple[str, Work, Work]:
    """A mask of `size` by twice as many pixels in an image of 640 by 480."""
    camera = table_cameras()[0]
    depth = np.random.default_rng(0).integers(600, 900, (camera.height, camera.width)).astype(np.uint16)
    mask = np.zeros(depth.shape, bool)
    mask[100 : 100 + size, 100 : 100 + 2 * size] = True

    open3d = load_open3d()
    tensor, unit = open3d.core.Tensor, camera.depth_unit_m

    def theirs() -> Cloud:
        image = open3d.t.geometry.Image(tensor(np.where(mask, depth, 0).astype(np.uint16)))
        where = tensor(camera.K), tensor(np.linalg.inv(camera.T_world_camera))
        cloud = open3d.t.geometry.PointCloud.create_from_depth_image(image, *where, depth_scale=1 / unit, depth_max=2.0)
        return cloud.point.positions.numpy()

    return f"depth to cloud, {mask.sum()} pixels", theirs, lambda: deproject(depth, mask, camera)


def one_a_voxel(points: Cloud) -> tuple[str, Work, Work]:
    """The mean of each voxel."""
    open3d = load_open3d()

    def theirs() -> Cloud:
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
        return np.asarray(cloud.voxel_down_sample(_VOXEL_M).points, np.float32)

    return f"one point a voxel, of {len(points)}", theirs, lambda: merge([points], _VOXEL_M)


def lonely_dropped(points: Cloud) -> tuple[str, Work, Work]:
    """Statistical outlier removal."""

    def plain() -> Cloud:
        distance, _ = KDTree(points).query(points, k=_NEIGHBOURS + 1)
        loneliness = distance[:, 1:].mean(axis=1)
        return points[loneliness <= loneliness.mean() + _SPREAD * loneliness.std()]

    return f"lonely points dropped, of {len(points)}", lambda: without_outliers(points, _NEIGHBOURS, _SPREAD), plain


def main() -> None:
    """Print the table."""
    clouds = [rope(count) for count in (3000, 12000, 40000)]
    pairs = [depth_to_cloud(40), depth_to_cloud(240), *map(one_a_voxel, clouds), *map(lonely_dropped, clouds)]
    table = Table("", "Open3D [ms]", "NumPy, SciPy [ms]", "ratio", "points", "points")
    for name, open3d, plain in pairs:
        theirs, own = milliseconds(open3d), milliseconds(plain)
        table.add_row(name, f"{theirs:.2f}", f"{own:.2f}", f"{own / theirs:.2f}", f"{len(open3d())}", f"{len(plain())}")
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
