"""The images agree with the geometry that they show, within the noise that they are given."""

import dataclasses

import numpy as np
import pytest

from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.rig.simulated.cameras.cameras import CameraNoise, table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.rig.simulated.worlds.world import Snapshot
from tests.rig.scene import FINGER, ROPE, straight_rope

NOISELESS = CameraNoise(depth_per_m=0.0, edge_dropout=0.0, grazing_dropout=0.0, colour_levels=0.0)
CAMERAS = table_cameras(2)
both_cameras = pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)


def snapshot() -> Snapshot:
    return RopeWorld(ROPE, FINGER, straight_rope()).snapshot()


def image(camera: CameraModel, noise: CameraNoise = NOISELESS, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    return render(snapshot(), camera, np.random.default_rng(seed), stage=Stage(body=ROPE, tool=FINGER), noise=noise)


def points(camera: CameraModel, depth: np.ndarray) -> np.ndarray:
    """World coordinates (height, width, 3) [m] of every pixel."""
    v, u = np.indices(depth.shape)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
    return (
        rays * (depth * camera.depth_unit_m)[..., None] @ camera.T_world_camera[:3, :3].T + camera.T_world_camera[:3, 3]
    )


def on_rope(color: np.ndarray) -> np.ndarray:
    return color[..., 0].astype(int) > color[..., 1].astype(int) + 60


def on_table(camera: CameraModel, color: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Grey pixels well inside the table top."""
    x, y, _ = np.moveaxis(points(camera, depth), -1, 0)
    inside = (np.abs(x - 0.55) < 0.4) & (np.abs(y) < 0.5) & (depth > 0)
    return inside & ~on_rope(color) & (color.min(axis=-1) > 100) & (np.ptp(color.astype(int), axis=-1) < 10)


@both_cameras
def test_the_table_is_at_height_zero_in_every_pixel(camera: CameraModel) -> None:
    color, depth = image(camera)
    heights = points(camera, depth)[on_table(camera, color, depth)][:, 2]
    assert len(heights) > 0.5 * depth.size
    # Half a depth unit of rounding is all that is left without noise.
    assert np.abs(heights).max() < 0.6 * camera.depth_unit_m


@both_cameras
def test_every_pixel_of_the_rope_lies_on_its_surface(camera: CameraModel) -> None:
    color, depth = image(camera)
    surface = points(camera, depth)[on_rope(color)]
    middle = snapshot().nodes
    fine = np.stack([np.interp(np.linspace(0, 1, 800), np.linspace(0, 1, len(middle)), axis) for axis in middle.T], 1)
    away = np.linalg.norm(surface[:, None] - fine[None], axis=-1).min(axis=1)
    assert len(surface) > 1500
    assert np.abs(away - ROPE.radius_m).max() < 1.5e-3


def test_both_cameras_see_the_whole_workspace_between_them() -> None:
    corners = np.array([[x, y, 0.0, 1.0] for x in (0.25, 0.85) for y in (-0.35, 0.35)])
    seen = np.zeros(4, dtype=bool)
    for camera in CAMERAS:
        at = (corners @ np.linalg.inv(camera.T_world_camera).T)[:, :3] @ camera.K.T
        u, v = at[:, 0] / at[:, 2], at[:, 1] / at[:, 2]
        seen |= (u > 0) & (u < camera.width - 1) & (v > 0) & (v < camera.height - 1)
    assert np.all(seen)


def test_depth_noise_grows_with_the_square_of_depth() -> None:
    camera, noise = CAMERAS[0], dataclasses.replace(NOISELESS, depth_per_m=2e-3)
    color, clean = image(camera)
    shots = np.stack([image(camera, noise, seed)[1] for seed in range(12)]).astype(float) * camera.depth_unit_m
    table = on_table(camera, color, clean)
    depth, spread = clean[table] * camera.depth_unit_m, shots.std(axis=0, ddof=1)[table]
    rounding = camera.depth_unit_m / np.sqrt(12)
    for low, high in ((0.65, 0.70), (0.80, 0.85), (0.95, 1.00)):
        band = (depth > low) & (depth < high)
        expected = np.sqrt(np.mean((noise.depth_per_m * depth[band] ** 2) ** 2) + rounding**2)
        assert np.sqrt(np.mean(spread[band] ** 2)) == pytest.approx(expected, rel=0.05)


def test_depth_is_missing_at_edges_and_hardly_anywhere_else() -> None:
    _, depth = image(CAMERAS[0], CameraNoise())
    table = on_table(CAMERAS[0], *image(CAMERAS[0]))
    assert (depth[table] == 0).mean() < 0.01
    assert (depth == 0).sum() > 100


def test_the_same_seed_gives_the_same_images_and_another_gives_others() -> None:
    first, again, other = (image(CAMERAS[1], CameraNoise(), seed) for seed in (1, 1, 2))
    assert np.array_equal(first[0], again[0])
    assert np.array_equal(first[1], again[1])
    assert not np.array_equal(first[1], other[1])


def test_the_finger_hides_what_is_behind_it() -> None:
    world = RopeWorld(ROPE, FINGER, straight_rope(), tool=(0.5, 0.12, 0.05))
    color, _ = render(
        world.snapshot(), CAMERAS[0], np.random.default_rng(0), stage=Stage(body=ROPE, tool=FINGER), noise=NOISELESS
    )
    assert on_rope(color).sum() < on_rope(image(CAMERAS[0])[0]).sum()


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_cameras_stand_around_the_table_and_look_at_it_level(count: int) -> None:
    cameras = table_cameras(count)
    assert len({camera.name for camera in cameras}) == count
    for camera in cameras:
        R = camera.T_world_camera[:3, :3]
        assert np.allclose(R.T @ R, np.eye(3))
        assert np.linalg.det(R) == pytest.approx(1.0)
        assert R[2, 0] == pytest.approx(0.0), "the image's x axis is level"
        assert R[2, 2] < -0.5, "it looks down"
