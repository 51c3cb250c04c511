"""Pushes of MuJoCo's ropes in arrays of the plain import format, in any frame and with more or less said of them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, final

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.geometry.shapes.tools import Finger
from app.discovery.dataset.study import Study
from app.policy.random_pushes import PushDesign
from app.tasks.elements.base import Task
from bench.hidden.ropes import RopeCase
from tests.plain_data import offsets_of

MIDDLE_M = np.array([0.55, 0.0, 0.0])
"""About which the pushes are made."""
_TOOL_POINTS, _TOOL_NOISE_M = 80, 1e-3


@final
@dataclass(frozen=True, kw_only=True)
class Place:
    """A table of which the middle is at `at_m` in the frame of the data, tilted about their x axis after a turn."""

    at_m: tuple[float, float, float] = (0.55, 0.0, 0.0)
    turn_deg: float = 0.0
    tilt_deg: float = 0.0

    @property
    def turn(self) -> Rotation:
        return Rotation.from_euler("x", self.tilt_deg, degrees=True) * Rotation.from_euler(
            "z", self.turn_deg, degrees=True
        )

    def points(self, x: np.ndarray) -> np.ndarray:
        return (self.turn.apply(np.asarray(x, np.float64).reshape(-1, 3) - MIDDLE_M) + self.at_m).astype(np.float32)

    def poses(self, given: np.ndarray) -> np.ndarray:
        turned = self.turn * Rotation.from_quat(given[:, 3:], scalar_first=True)
        place = self.turn.apply(given[:, :3] - MIDDLE_M) + self.at_m
        return np.concatenate([place, turned.as_quat(scalar_first=True)], axis=1)


@cache
def recorded(seed: int, episodes: int = 2, pushes: int = 3) -> tuple[Task, Study]:
    """A rope of drawn size, and pushes of it. Nothing is hidden."""
    case = RopeCase(seed=seed, plan=PushDesign(episodes=episodes, pushes=pushes))
    return case.task, case.record()


def said(task: Task) -> dict[str, Any]:
    """All that can be said of object and tool."""
    rope, finger = task.rope, task.finger
    return {
        "object": {"length_m": rope.length_m, "radius_m": rope.radius_m, "mass_kg": rope.mass_kg},
        "tool": {"shape": "cylinder", "radius_m": finger.radius_m},
    }


def measured_arrays(
    study: Study,
    finger: Finger,
    *,
    place: Place | None = None,
    about: Mapping[str, Any] | None = None,
    table: bool = True,
    seen_rad: float = np.pi,
    seed: int = 0,
) -> dict[str, Any]:
    """The arrays of a study whose tool is seen from one side: so much of the circle around it."""
    rng, place = np.random.default_rng(seed), place or Place()
    clouds, tools, rows = list[np.ndarray](), list[np.ndarray](), list[tuple[float, int, int, str]]()
    tracks: dict[str, list[np.ndarray]] = {f"{kind}_{of}": [] for kind in ("command", "state") for of in _OF}
    counts: dict[int, int] = {}
    for push in study.pushes:
        number = counts.get(push.episode, 0)
        counts[push.episode] = number + 1
        views = [(push.before, "before"), *((view, "during") for view in push.during), (push.after, "after")]
        for view, phase in views:
            clouds.append(place.points(view.points))
            rows.append((view.time_s, push.episode, number, phase))
            tip = push.track.at(np.array([view.time_s]))[0]
            surface = _side(finger, rng, seen_rad) + tip if phase == "during" else np.zeros((0, 3))
            tools.append(place.points(surface))
        for kind, track in (("command", push.command), ("state", push.track)):
            tracks[f"{kind}_time"].append(track.times_s)
            tracks[f"{kind}_pose"].append(place.poses(track.poses))
            tracks[f"{kind}_episode"].append(np.full(len(track.times_s), push.episode, np.int32))
    times, episodes, numbers, phases = (np.array(column) for column in zip(*rows, strict=True))
    arrays = {name: np.concatenate(parts) for name, parts in tracks.items()} | {
        "cloud_points": np.concatenate(clouds),
        "cloud_offsets": offsets_of(clouds),
        "cloud_time": times,
        "cloud_episode": episodes.astype(np.int32),
        "cloud_push": numbers.astype(np.int32),
        "cloud_phase": phases,
        "tool_points": np.concatenate(tools),
        "tool_offsets": offsets_of(tools),
        "about": np.array(json.dumps({"task": "rope_push", **(about or {})})),
    }
    if not table:
        return arrays
    tables = [place.points(study.tables[number]) for number in counts]
    return arrays | {
        "table_points": np.concatenate(tables),
        "table_offsets": offsets_of(tables),
        "table_episode": np.array(list(counts), np.int32),
    }


_OF = ("time", "pose", "episode")


def _side(finger: Finger, rng: np.random.Generator, seen_rad: float) -> np.ndarray:
    """Points of the tool's upright side relative to its tip, with noise; of a flat one the whole outline."""
    height = rng.uniform(0.012, 0.040, _TOOL_POINTS)
    if finger.half_width_m == 0:
        angle = rng.uniform(0.0, seen_rad, _TOOL_POINTS)
        side = finger.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        x, y = finger.half_width_m + finger.radius_m, finger.radius_m
        corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y], [-x, -y]])
        edges = list(pairwise(corners))
        length = np.array([np.linalg.norm(b - a) for a, b in edges])
        chosen = rng.choice(len(edges), _TOOL_POINTS, p=length / length.sum())
        share = rng.uniform(0, 1, _TOOL_POINTS)[:, None]
        box = np.array([edges[k][0] for k in chosen]) * (1 - share) + np.array([edges[k][1] for k in chosen]) * share
        c, s = np.cos(finger.yaw_rad), np.sin(finger.yaw_rad)
        side = box @ np.array([[c, s], [-s, c]])
    return np.column_stack([side, height]) + rng.normal(0, _TOOL_NOISE_M, (_TOOL_POINTS, 3))
