"""An analytic scene to test perception on, independent of the rig's: a tube on a table and a flawed sensor.

The truth is known in closed form: the points within the radius of a polyline.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from app.config import Workspace
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame, fresh_id
from app.core.system.shared_libraries import load_open3d
from app.tasks.elements.curves import random_curve
from bench.tube import Tube

RADIUS_M = 0.008
ROPE_RGB = (0.80, 0.25, 0.15)
TABLE_RGB = (0.35, 0.40, 0.45)
FINGER_RGB = (0.15, 0.15, 0.18)
_TABLE, _ROPE, _FINGER, _NOTHING = 0, 1, 2, 3


def random_tube(seed: int, length_m: float = 0.40) -> Tube:
    """A tube resting on the table along a random curve."""
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, length_m=length_m, height_m=RADIUS_M, workspace=Workspace())
    return Tube(curve=curve, radius_m=RADIUS_M)


def camera_at(
    eye: Sequence[float], target: Sequence[float] = (0.55, 0.0, 0.0), *, name: str, roll_rad: float = 0.0
) -> CameraModel:
    """A 640 x 480 camera at `eye` that looks at `target`, rolled about its optical axis."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    upright = np.stack([right, np.cross(forward, right), forward], axis=1)
    roll = cv2.Rodrigues(np.array([0.0, 0.0, roll_rad]))[0]
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = upright @ roll
    T_world_camera[:3, 3] = eye
    K = np.array([[610.0, 0.0, 318.3], [0.0, 609.0, 241.7], [0.0, 0.0, 1.0]])
    return CameraModel(name=name, width=640, height=480, K=K, T_world_camera=T_world_camera, depth_unit_m=0.001)


def two_cameras() -> tuple[CameraModel, CameraModel]:
    """Two cameras, one on either side of the table, 0.75 m from its middle."""
    return camera_at((0.55, 0.50, 0.56), name="left"), camera_at((0.55, -0.50, 0.56), name="right")


def render(
    tube: Tube,
    camera: CameraModel,
    rng: np.random.Generator,
    *,
    noise_m: float = 0.001,
    dropout: float = 0.02,
    flying: float = 0.5,
    finger_xy: tuple[float, float] | None = None,
    time_s: float = 0.0,
) -> Frame:
    """Frame that `camera` takes of the tube on the table, and of a finger over it.

    `noise_m`: standard deviation of the depth. `dropout`: share of the pixels without a reading, half of them in
    patches. `flying`: share of the pixels at depth edges that report a mixture of front and background.
    """
    depth_m, what, shade = _cast(tube, camera, finger_xy)
    palette = np.array([TABLE_RGB, ROPE_RGB, FINGER_RGB, (0.0, 0.0, 0.0)])
    color = 255 * palette[what] * shade[..., None] + rng.normal(0, 4, (*depth_m.shape, 3))
    depth_m = _with_flying_pixels(depth_m, flying, rng) + rng.normal(0, noise_m, depth_m.shape)
    depth_m[rng.random(depth_m.shape) < dropout / 2] = 0
    depth_m[_patches(depth_m.shape, dropout / 2, rng)] = 0
    depth = np.rint(np.nan_to_num(depth_m, posinf=0.0) / camera.depth_unit_m)
    return Frame(
        id=fresh_id("frame"),
        time_s=time_s,
        camera=camera,
        color=np.clip(color, 0, 255).astype(np.uint8),
        depth=np.clip(depth, 0, 65535).astype(np.uint16),
    )


def views(tube: Tube, seed: int = 0, **flaws: float) -> list[Frame]:
    """The tube from both sides."""
    rng = np.random.default_rng(seed)
    return [render(tube, camera, rng, **flaws) for camera in two_cameras()]


def turned_quarter(frame: Frame) -> Frame:
    """The same view from a camera that is turned by 90 degrees about its optical axis: no pixel is lost."""
    camera = frame.camera
    K = np.array(
        [
            [camera.K[1, 1], 0.0, camera.height - 1 - camera.K[1, 2]],
            [0.0, camera.K[0, 0], camera.K[0, 2]],
            [0.0, 0.0, 1.0],
        ]
    )
    T_camera_turned = np.eye(4)
    T_camera_turned[:3, :3] = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    turned = replace(
        camera,
        width=camera.height,
        height=camera.width,
        K=K,
        T_world_camera=camera.T_world_camera @ T_camera_turned,
    )
    return replace(
        frame,
        camera=turned,
        color=np.ascontiguousarray(np.rot90(frame.color, -1)),
        depth=np.ascontiguousarray(np.rot90(frame.depth, -1)),
    )


def _cast(
    tube: Tube, camera: CameraModel, finger_xy: tuple[float, float] | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth [m] (inf: nothing), what is seen there, and its shade in 0..1, each (height, width)."""
    o3d = load_open3d()
    scene = o3d.t.geometry.RaycastingScene()
    table = o3d.geometry.TriangleMesh.create_box(1.6, 1.6, 0.02).translate((-0.25, -0.8, -0.02))
    meshes = [table, _swept(tube)]
    if finger_xy is not None:
        finger = o3d.geometry.TriangleMesh.create_cylinder(0.012, 0.30, 24)
        meshes.append(finger.translate((*finger_xy, 0.15 + 2.2 * tube.radius_m)))
    for mesh in meshes:
        scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    # Directions of unit depth, so that the distance along a ray is the depth.
    row, column = np.mgrid[: camera.height, : camera.width].astype(float)
    directions = np.stack([column, row, np.ones_like(row)], axis=-1) @ np.linalg.inv(camera.K).T
    directions = directions @ camera.T_world_camera[:3, :3].T
    origins = np.broadcast_to(camera.T_world_camera[:3, 3], directions.shape)
    hits = scene.cast_rays(o3d.core.Tensor(np.concatenate([origins, directions], -1).astype(np.float32)))
    what = np.minimum(hits["geometry_ids"].numpy(), _NOTHING).astype(int)
    light = np.array([0.3, 0.2, 0.93])
    shade = 0.35 + 0.65 * np.clip(np.abs(hits["primitive_normals"].numpy() @ light), 0, 1)
    return hits["t_hit"].numpy().astype(float), what, shade


def _swept(tube: Tube, sides: int = 32):
    """The tube's skin as triangles, with half-spheres at its ends."""
    o3d = load_open3d()
    tangent = np.gradient(tube.curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(tangent, up)
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * up
    vertices = (tube.curve[:, None] + tube.radius_m * ring).reshape(-1, 3)
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(len(tube.curve) - 1), np.arange(sides), indexing="ij"))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    triangles = np.concatenate([np.stack([a, b, a + sides], 1), np.stack([b, b + sides, a + sides], 1)])
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(triangles))
    for end in (tube.curve[0], tube.curve[-1]):
        mesh += o3d.geometry.TriangleMesh.create_sphere(tube.radius_m, 24).translate(end)
    return mesh


def _with_flying_pixels(depth_m: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Some pixels beside a depth edge report a value between the two sides."""
    solid = np.where(np.isfinite(depth_m), depth_m, 0).astype(np.float32)
    kernel = np.ones((3, 3), np.uint8)
    near, far = cv2.erode(solid, kernel), cv2.dilate(solid, kernel)
    flies = (far - near > 0.006) & (near > 0) & (rng.random(depth_m.shape) < share)
    mixture = near + rng.random(depth_m.shape) * (far - near)
    return np.where(flies, mixture, depth_m)


def _patches(shape: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    """Blobs of a few pixels that cover about `share` of the image."""
    seeds = (rng.random(shape) < share / 25).astype(np.uint8)
    return cv2.dilate(seeds, np.ones((5, 5), np.uint8)).astype(bool)
