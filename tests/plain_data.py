"""Pushes as other programs would have measured them, in arrays of the plain import format. Nothing is simulated."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from app.core.geometry.track import Track
from app.policy.random_pushes import PushDesign, midway_s, random_track
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push")
POINTS = TASK.preset("cpu").particle_count
EPISODES, PUSHES = 2, 3
OPTIONAL = ("state", "tool", "table")


def plain_arrays(*, without: tuple[str, ...] = (), points: int = POINTS, seed: int = 0) -> dict[str, Any]:
    """A whole file, but for the optional arrays whose kind is in `without` and clouds during pushes ("during")."""
    rng, now_s = np.random.default_rng(seed), 0.0
    clouds, rows, tools = list[np.ndarray](), list[tuple[float, int, int, str]](), list[np.ndarray]()
    tracks, episodes = list[Track](), list[int]()
    for episode in range(EPISODES):
        x = fill_tube(TASK.start(episode), TASK.rope.radius_m, points)
        for push in range(PUSHES):
            track = random_track(rng, x, PushDesign(), start_s=now_s + 1.0, height_m=TASK.finger.push_height_m)
            middle_s, end_s = midway_s(track.times_s), float(track.times_s[-1]) + 0.5
            for time_s, phase in ((now_s + 0.5, "before"), (middle_s, "during"), (end_s, "after")):
                if phase == "during" and "during" in without:
                    continue
                x = (x + rng.normal(0, 1e-3, x.shape)).astype(np.float32)
                tip = track.at(np.array([time_s]))
                clouds.append(x)
                rows.append((time_s, episode, push, phase))
                tools.append((tip + rng.normal(0, 1e-3, (12, 3))).astype(np.float32)[: 12 * (phase == "during")])
            now_s = end_s + 1.0
            tracks.append(track)
            episodes += [episode] * len(track.times_s)
    times, poses = (np.concatenate([getattr(track, name) for track in tracks]) for name in ("times_s", "poses"))
    tables = [rng.uniform([0.3, -0.3, 0], [0.8, 0.3, 1e-3], (40, 3)).astype(np.float32) for _ in range(EPISODES)]
    column = [np.array(values) for values in zip(*rows, strict=True)]
    arrays = {
        "cloud_points": np.concatenate(clouds),
        "cloud_offsets": offsets_of(clouds),
        "cloud_time": column[0],
        "cloud_episode": column[1].astype(np.int32),
        "cloud_push": column[2].astype(np.int32),
        "cloud_phase": column[3],
        "command_time": times,
        "command_pose": poses,
        "command_episode": np.array(episodes, np.int32),
        # The arm's log has a rhythm of its own.
        "state_time": times[::3] + 1e-3,
        "state_pose": poses[::3],
        "state_episode": np.array(episodes, np.int32)[::3],
        "tool_points": np.concatenate(tools),
        "tool_offsets": offsets_of(tools),
        "table_points": np.concatenate(tables),
        "table_offsets": offsets_of(tables),
        "table_episode": np.arange(EPISODES, dtype=np.int32),
        "about": np.array(json.dumps({"task": "rope_push", "object": {"kind": "rope", "length_m": 0.4}})),
    }
    return {name: array for name, array in arrays.items() if not name.startswith(tuple(f"{kind}_" for kind in without))}


def saved(folder: Path, arrays: dict[str, Any]) -> Path:
    """The arrays in a file."""
    path = folder / "measured.npz"
    np.savez(path, **arrays)
    return path


def offsets_of(clouds: list[np.ndarray]) -> np.ndarray:
    """Offsets of their beginnings, and of the end of the last."""
    return np.cumsum([0, *map(len, clouds)]).astype(np.int64)
