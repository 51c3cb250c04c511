"""Eight pushes of a real rope, which lie beside the checkout, as `dipac import` and discovery read them.

Robot base frame, z up [m]. What was not recorded is assumed here, and nowhere else: each assumption is a constant.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

import cv2
import numpy as np
from jaxtyping import Float64

from app.core.errors import UsageError
from app.core.types import Cloud
from app.discovery.dataset.model_under_test import Subject
from app.jobs.discovery_subject import subject_of
from app.perception.body.fill import CELL_M, Underside, fill, points_inside
from app.sim.model.scene import Body
from app.tasks import load

FOLDER: Final = Path(__file__).parents[2] / "shared" / "data" / "real_rope_pushes"
RADIUS_M: Final = 0.006
"""Half of the rope's width in the clouds, 10.2 mm between the outermost points and half their spacing on each side."""
SHIFT_M: Final = np.array([0.10, -0.35])
"""Added to x and y: where they were recorded the rope reaches beyond the task's table."""
SPEED_M_S: Final = 0.10
"""Assumed speed, as it was not recorded: slow enough for a rope to be at rest in all but contact."""
TIP_M: Final = 0.006
"""The tip's height in the middle of the rope. The recorded 24 mm is over its top: of another point of the gripper."""
DOWN: Final = (0.0, 1.0, 0.0, 0.0)
"""Orientation of the gripper, down with the base's yaw: it was not recorded."""
_PERIOD_S, _PAUSE_S = 0.02, 0.3
_BODY_SPACING_M = 0.003


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Recorded:
    """A push: clouds before and after it, and where the closed gripper began and ended [m]."""

    name: str
    before: Cloud
    after: Cloud
    start: Float64[np.ndarray, "3"]
    end: Float64[np.ndarray, "3"]


def recorded_pushes(folder: Path = FOLDER) -> list[Recorded]:
    """All of them, in the order of their names. Raises UsageError where they are absent."""
    files = sorted(folder.glob("push_*.npz"))
    if not files:
        raise UsageError(f"There are no pushes in {folder}; put push_NN.npz there, as docs/real-data.md says.")
    found = list[Recorded]()
    for file in files:
        with np.load(file) as arrays:
            found.append(
                Recorded(
                    name=file.stem.removeprefix("push_"),
                    before=_shifted(arrays["before"]).astype(np.float32),
                    after=_shifted(arrays["after"]).astype(np.float32),
                    start=_shifted(arrays["push_start"]),
                    end=_shifted(arrays["push_end"]),
                )
            )
    return found


def body_of(cloud: Cloud) -> Cloud:
    """Points throughout the rope that a cloud shows, standing on the table [m].

    Heights are not used: who recorded them filled the inside by copies of the cloud 6 and 12 mm below it, and no cloud
    shows the table. The outline seen from above is a tube as wide as the rope; the tassels at its ends, which are
    wider, are as flat as the rope is high, with round edges.
    """
    level = cloud.copy()
    level[:, 2] = 2 * RADIUS_M
    outline = _filled(level, "flat").top > 0
    depth = cv2.distanceTransform(np.pad(outline, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1] * CELL_M
    share = 1 - np.minimum(depth / RADIUS_M, 1.0)
    row, column = np.nonzero(outline)
    top = np.stack([row, column], axis=1) * CELL_M + _corner(level)
    height = RADIUS_M * (1 + np.sqrt(1 - share[row, column] ** 2))
    solid = _filled(np.column_stack([top, height]).astype(np.float32), "round")
    return points_inside(solid, _BODY_SPACING_M)


def volume_m3(pushes: list[Recorded]) -> float:
    """The rope's volume, the median of all clouds."""
    bodies = [body_of(cloud) for push in pushes for cloud in (push.before, push.after)]
    return float(np.median([len(body) for body in bodies])) * _BODY_SPACING_M**3


def real_rope(pushes: list[Recorded]) -> Subject:
    """The task's simulator with a rope as thin and as heavy as this one; its density is the task's."""
    subject = subject_of(load("rope_push"))
    (body,) = subject.scene.bodies
    volume = volume_m3(pushes)
    slender = Body(volume_m3=volume, density_kg_m3=body.density_kg_m3)
    return replace(
        subject,
        scene=replace(subject.scene, bodies=(slender,)),
        mass_kg=volume * body.density_kg_m3,
        radius_m=RADIUS_M,
    )


def write_plain(pushes: list[Recorded], file: Path) -> None:
    """All pushes in the plain import format, each an episode of its own."""
    clouds, times, poses, numbers, seen = list[Cloud](), list[np.ndarray](), list[np.ndarray](), list[int](), [0.0]
    moments = list[float]()
    for number, push in enumerate(pushes):
        way = _command(push)
        clock = seen[-1] + _PAUSE_S + np.arange(len(way)) * _PERIOD_S
        clouds += [body_of(push.before), body_of(push.after)]
        moments += [clock[0] - _PERIOD_S, clock[-1] + _PAUSE_S]
        seen.append(moments[-1])
        # Motion is whatever was commanded between the two views.
        times.append(np.array([moments[-2], *clock, moments[-1]]))
        poses.append(np.concatenate([way[:1], way, way[-1:]]))
        numbers += [number] * (len(way) + 2)
    count = len(clouds)
    np.savez(
        file,
        cloud_points=np.concatenate(clouds).astype("f4"),
        cloud_offsets=np.cumsum([0, *map(len, clouds)]),
        cloud_time=np.array(moments),
        cloud_episode=np.arange(count, dtype="i4") // 2,
        cloud_push=np.zeros(count, "i4"),
        cloud_phase=np.array(["before", "after"] * len(pushes)),
        command_time=np.concatenate(times),
        command_pose=np.concatenate(poses),
        command_episode=np.array(numbers, "i4"),
        about=json.dumps({"task": "rope_push", "object": {"kind": "rope", "radius_m": RADIUS_M, "length_m": 0.40}}),
    )


def _command(push: Recorded) -> Float64[np.ndarray, "T 7"]:
    """Commanded track: down at the start, straight to the end at the assumed speed, and up."""
    steps = round(float(np.linalg.norm(push.end - push.start)) / (SPEED_M_S * _PERIOD_S))
    share = np.concatenate([np.zeros(10), np.linspace(0, 1, steps + 1), np.ones(10)])
    way = push.start + share[:, None] * (push.end - push.start)
    way[:, 2] = np.concatenate([np.linspace(0.08, TIP_M, 10), np.full(steps + 1, TIP_M), np.linspace(TIP_M, 0.08, 10)])
    return np.column_stack([way, np.tile(DOWN, (len(way), 1))])


def _shifted(points: np.ndarray) -> Float64[np.ndarray, "*batch 3"]:
    moved = points.astype(np.float64)
    moved[..., :2] += SHIFT_M
    return moved


def _filled(surface: Cloud, underside: Underside):
    return fill(surface, table_m=0.0, half_width_m=RADIUS_M, underside=underside)


def _corner(surface: Cloud) -> Float64[np.ndarray, "2"]:
    return _filled(surface, "flat").corner
