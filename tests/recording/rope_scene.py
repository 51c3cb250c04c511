"""A straight rope on a table that a finger pushes aside, as a camera above it sees it; no engine, no noise."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

RADIUS_M, LENGTH_M = 0.008, 0.36
MIDDLE_M = 0.5
CAMERA_M = (0.5, 0.0, 0.7)
WIDTH, HEIGHT, FOCAL = 320, 240, 260.0
K = np.array([[FOCAL, 0.0, WIDTH / 2 - 0.5], [0.0, FOCAL, HEIGHT / 2 - 0.5], [0.0, 0.0, 1.0]])
DOWN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""Axes of a camera that looks down on a table, in the base's."""
ROPE_RGB, TABLE_RGB = (230, 110, 20), (120, 120, 120)
HIGH_M, LOW_M = 0.12, 0.006
PUSH_M = 0.08


def camera_pose() -> np.ndarray:
    """`T_base_camera`."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = DOWN, CAMERA_M
    return T


@final
@dataclass(frozen=True, kw_only=True)
class RopeScene:
    """Pushes along x, each from a rest; the rope goes ahead of the finger. `step_s`: time between poses."""

    pushes: int = 2
    step_s: float = 0.02
    image_s: float = 0.25
    start_s: float = 0.0
    at: list[float] = field(default_factory=list[float])

    def tool(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] and places (T, 3) [m] of the tip, without the start."""
        times, places, now_s, rope_m = list[float](), list[np.ndarray](), 0.0, MIDDLE_M
        for _ in range(self.pushes):
            behind, ahead = rope_m - 0.05, rope_m - 0.05 + PUSH_M
            corners = [(behind, HIGH_M), (behind, LOW_M), (ahead, LOW_M), (ahead, HIGH_M), (rope_m - 0.02, HIGH_M)]
            for seconds, (a, b) in zip(
                (1.0, 0.6, 0.8, 0.6, 0.4), zip([corners[0], *corners[:-1]], corners, strict=True), strict=True
            ):
                count = round(seconds / self.step_s)
                for share in np.arange(count) / count:
                    x, z = np.array(a) + share * (np.array(b) - np.array(a))
                    times.append(now_s)
                    places.append(np.array([x, 0.0, z]))
                    now_s += self.step_s
            rope_m = ahead + RADIUS_M + 0.008 - 0.02
        for _ in range(round(1.0 / self.step_s)):
            times.append(now_s)
            places.append(places[-1])
            now_s += self.step_s
        return np.array(times), np.array(places)

    def image_times(self) -> np.ndarray:
        """Times of the images [s]."""
        return np.arange(0.0, self.tool()[0][-1], self.image_s)

    def rope_at(self, time_s: float) -> float:
        """Place of the rope along x [m]."""
        times, places = self.tool()
        reached, rope_m = times <= time_s, MIDDLE_M
        for x, _, z in places[reached]:
            if z < 0.02:
                rope_m = max(rope_m, x + RADIUS_M + 0.008)
        return rope_m

    def images(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Colours (H, W, 3), and depth (H, W) [m]."""
        return render(self.rope_at(time_s))

    def surface(self, time_s: float, count: int = 800, seed: int = 0) -> np.ndarray:
        """Points (M, 3) [m] of the rope's upper side."""
        rng = np.random.default_rng(seed)
        angle, along = rng.uniform(0, np.pi, count), rng.uniform(-LENGTH_M / 2, LENGTH_M / 2, count)
        x = self.rope_at(time_s) + RADIUS_M * np.cos(angle)
        return np.column_stack([x, along, RADIUS_M * (1 + np.sin(angle))]).astype(np.float32)


def render(rope_m: float) -> tuple[np.ndarray, np.ndarray]:
    """The view from above: a cylinder along y on the table."""
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([(u - K[0, 2]) / FOCAL, -(v - K[1, 2]) / FOCAL, -np.ones(u.shape)], axis=-1)
    origin = np.array(CAMERA_M)
    depth = np.full(u.shape, CAMERA_M[2])
    # Where the ray meets the cylinder about (rope_m, radius): a quadratic in its length.
    x, z = origin[0] - rope_m, origin[2] - RADIUS_M
    a, b = rays[..., 0] ** 2 + 1, rays[..., 0] * x - z
    inside = b**2 - a * (x**2 + z**2 - RADIUS_M**2)
    near = (-b - np.sqrt(np.maximum(inside, 0))) / a
    y = origin[1] + near * rays[..., 1]
    rope = (inside > 0) & (np.abs(y) < LENGTH_M / 2)
    color = np.where(rope[..., None], np.array(ROPE_RGB, np.uint8), np.array(TABLE_RGB, np.uint8))
    return color.astype(np.uint8), np.where(rope, near, depth)


def poses(places: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Poses (T, 7) of a tool that points down."""
    return np.column_stack([np.asarray(places), np.tile([0.0, 1.0, 0.0, 0.0], (len(places), 1))])
