"""RGB-D images of a snapshot of the world, by ray casting. Pure: the same snapshot, camera and generator, same images.

The table and the floor are static planes: they are intersected once a camera. Moving surfaces are cast with Open3D, and
only through the pixels that they can cover.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Stage
from app.core.system.shared_libraries import load_open3d
from app.core.types import ColourImage, DepthImage
from app.rig.simulated.cameras.appearance import surfaces
from app.rig.simulated.cameras.cameras import CameraNoise
from app.rig.simulated.worlds.shapes import Surface
from app.rig.simulated.worlds.world import Snapshot

Image: TypeAlias = Float32[np.ndarray, "height width"]
Directions: TypeAlias = Float32[np.ndarray, "height width 3"]

_TABLE_LOW_M, _TABLE_HIGH_M = (0.05, -0.62), (1.05, 0.62)
_FLOOR_M = -0.75
_TABLE_GREY, _FLOOR_GREY = 0.55, 0.22
_LIGHT = np.array([0.25, -0.15, 0.956], dtype=np.float32)
_AMBIENT, _DIFFUSE = 0.42, 0.58
_NEAREST_M = 0.05
_SUBPIXEL_BITS = 4


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Layer:
    """A noiseless image: depth [m], RGB (0..255), and the cosine between view ray and surface normal."""

    depth: Image
    colour: Float32[np.ndarray, "height width 3"]
    facing: Image


def render(
    snapshot: Snapshot,
    camera: CameraModel,
    rng: np.random.Generator,
    *,
    stage: Stage,
    noise: CameraNoise | None = None,
) -> tuple[ColourImage, DepthImage]:
    """The image pair that `camera` takes of `snapshot`: RGB and aligned depth (in the camera's unit, 0 = none)."""
    layer = _with_moving(_background(camera), surfaces(snapshot, stage), camera)
    return _expose(layer, camera, rng, noise or CameraNoise())


def _directions(camera: CameraModel) -> Directions:
    """A ray per pixel in the world frame, of unit length along the optical axis, so that its parameter is depth."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([u, v, np.ones_like(u)], axis=-1)
    turn = camera.T_world_camera[:3, :3] @ np.linalg.inv(camera.K)
    return (pixels @ turn.T).astype(np.float32)


@lru_cache(maxsize=8)
def _rays(camera: CameraModel) -> Directions:
    return _directions(camera)


@lru_cache(maxsize=8)
def _background(camera: CameraModel) -> _Layer:
    """Table top and floor as `camera` sees them."""
    eye, rays = camera.T_world_camera[:3, 3], _rays(camera)
    down = np.minimum(rays[..., 2], -1e-6)
    to_table, to_floor = -eye[2] / down, (_FLOOR_M - eye[2]) / down
    at = eye[:2] + rays[..., :2] * to_table[..., None]
    table = np.all((at > _TABLE_LOW_M) & (at < _TABLE_HIGH_M), axis=-1)
    grey = 255 * np.where(table, _TABLE_GREY, _FLOOR_GREY) * (_AMBIENT + _DIFFUSE * _LIGHT[2])
    return _Layer(
        depth=np.where(table, to_table, to_floor).astype(np.float32),
        colour=np.repeat(grey[..., None], 3, axis=-1).astype(np.float32),
        facing=(-down / np.linalg.norm(rays, axis=-1)).astype(np.float32),
    )


def _with_moving(behind: _Layer, moving: list[Surface], camera: CameraModel) -> _Layer:
    """`behind` with the `moving` surfaces drawn where they are nearer."""
    rows, columns = np.nonzero(_coverage_mask(moving, camera))
    rays = _rays(camera)[rows, columns]
    depth, normals, albedo = _cast(moving, camera, rays)
    seen = depth < behind.depth[rows, columns]
    rows, columns, rays, normals = rows[seen], columns[seen], rays[seen], normals[seen]
    toward = np.einsum("ij,ij->i", normals, rays)
    normals *= -np.sign(toward)[:, None]
    light = _AMBIENT + _DIFFUSE * np.maximum(normals @ _LIGHT, 0.0)
    layer = _Layer(depth=behind.depth.copy(), colour=behind.colour.copy(), facing=behind.facing.copy())
    layer.depth[rows, columns] = depth[seen]
    layer.colour[rows, columns] = 255 * albedo[seen] * light[:, None]
    layer.facing[rows, columns] = np.abs(toward) / np.linalg.norm(rays, axis=1)
    return layer


def _coverage_mask(moving: list[Surface], camera: CameraModel) -> Bool[np.ndarray, "height width"]:
    """Mask of the pixels that the surfaces can cover: the hulls of their projected pieces, grown by a pixel."""
    mask = np.zeros((camera.height, camera.width), np.uint8)
    for surface in moving:
        _cover(mask, surface, camera)
    return cv2.dilate(mask, np.ones((3, 3), np.uint8)).astype(bool)


def _cover(mask: UInt8[np.ndarray, "height width"], surface: Surface, camera: CameraModel) -> None:
    """Fill the hulls of the surface's convex pieces.

    A piece that reaches behind the camera and is not beside the view covers everything.
    """
    R, eye = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
    pieces = ((surface.vertices - eye) @ R @ camera.K.T)[surface.pieces]
    pieces = pieces[~_beside(pieces, camera)]
    if np.any(pieces[..., 2] < _NEAREST_M):
        mask[:] = 1
        return
    pixels = (pieces[..., :2] / pieces[..., 2:] * 2**_SUBPIXEL_BITS).round().astype(np.int32)
    for piece in pixels:
        cv2.fillConvexPoly(mask, cv2.convexHull(piece), (1,), shift=_SUBPIXEL_BITS)


def _beside(pieces: Float64[np.ndarray, "P V 3"], camera: CameraModel) -> Bool[np.ndarray, " P"]:
    """Mask of pieces whose homogeneous pixels `(u z, v z, z)` are all beyond one side of the image, or behind it."""
    x, y, z = np.moveaxis(pieces, -1, 0)
    sides = np.stack([x < 0, x > camera.width * z, y < 0, y > camera.height * z, z < 0])
    return np.logical_or.reduce(sides.all(axis=-1), axis=0)


def _cast(
    moving: list[Surface], camera: CameraModel, rays: Float32[np.ndarray, "P 3"]
) -> tuple[Float32[np.ndarray, " P"], Float32[np.ndarray, "P 3"], Float64[np.ndarray, "P 3"]]:
    """Depth [m] (infinite where nothing is hit), normals and albedo of the nearest surface along each ray."""
    open3d = load_open3d()
    first = np.cumsum([0] + [len(surface.vertices) for surface in moving])
    vertices = np.concatenate([surface.vertices for surface in moving])
    triangles = np.concatenate([s.triangles + np.uint32(at) for s, at in zip(moving, first, strict=False)])
    owners = np.repeat(np.arange(len(moving)), [len(surface.triangles) for surface in moving])
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(triangles))
    eye = np.broadcast_to(camera.T_world_camera[:3, 3].astype(np.float32), rays.shape)
    hits = scene.cast_rays(open3d.core.Tensor(np.concatenate([eye, rays], axis=1)), nthreads=1)
    colours = np.array([surface.colour for surface in moving])
    triangle = np.minimum(hits["primitive_ids"].numpy(), len(owners) - 1)
    return hits["t_hit"].numpy(), hits["primitive_normals"].numpy(), colours[owners[triangle]]


def _expose(
    layer: _Layer, camera: CameraModel, rng: np.random.Generator, noise: CameraNoise
) -> tuple[ColourImage, DepthImage]:
    """The layer as the sensor outputs it: noisy, with holes, in integers."""
    size = layer.depth.shape
    depth = layer.depth + noise.depth_per_m * layer.depth**2 * rng.standard_normal(size, dtype=np.float32)
    chance = np.float32(noise.edge_dropout) * _edges(layer.depth, noise.edge_m)
    chance[layer.facing < np.sin(noise.grazing_rad)] = noise.grazing_dropout
    units = np.rint(depth / camera.depth_unit_m)
    doubtful = np.flatnonzero(chance)
    units.ravel()[doubtful[rng.random(len(doubtful)) < chance.ravel()[doubtful]]] = 0
    levels = layer.colour + noise.colour_levels * rng.standard_normal((*size, 1), dtype=np.float32)
    return np.clip(levels, 0, 255).astype(np.uint8), np.clip(units, 0, 65535).astype(np.uint16)


def _edges(depth: Image, jump_m: float) -> Bool[np.ndarray, "height width"]:
    """Mask of pixels whose depth differs from any of the four neighbours by more than `jump_m`."""
    edges = np.zeros(depth.shape, bool)
    across, along = np.abs(np.diff(depth, axis=1)) > jump_m, np.abs(np.diff(depth, axis=0)) > jump_m
    edges[:, 1:] |= across
    edges[:, :-1] |= across
    edges[1:] |= along
    edges[:-1] |= along
    return edges
