"""Cost of holes, flying pixels and flicker of cameras, and of the remedies: `dipac bench flaws`.

The rope at rest is seen twice. The second pair of images has one flaw more than the simulated cameras' own: patches of
no reading on a third of the rope, as it glitters; a mixture of front and background in half of the pixels at edges of
depth, of a rope held 6 cm over the table; or a band of rows in both images at a tenth of their brightness, as of a lamp
that flickers. Ways of seeing add up from row to row.

Covered: the share of the rope within 8 mm of a particle. Stray: the share of the fused surface farther than 3 mm
outside the rope. Pixels: those of the rope and around it, of both images, that have no reading, and whose reading is
wrong by more than 6 mm.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree

from app.core.errors import PerceptionError
from app.core.messages import Frame
from app.core.motion import pointing_down
from app.perception.body.temporal_depth_filter import JUMP_M, filter_depth
from app.perception.cloud.depth import nearest
from app.perception.reconstruct import PriorKnowledge, Reconstruction, reconstruct
from app.rig.simulated.cameras.cameras import CameraNoise, table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.physics import HOME_TOOL_M
from app.rig.simulated.worlds.world import Snapshot
from app.tasks.rope_push import TASK
from bench.occlusion import photographed
from bench.tube import Tube

_NEAR_M, _STRAY_M = 0.008, 0.003
_GLITTER, _PATCH, _MIXED, _DIM = 1 / 3, 9, 0.5, 0.1
_BAND = slice(170, 310)
_HELD_M = 0.06
_EDGE_M = 0.006
_PERFECT = CameraNoise(depth_per_m=0.0, edge_dropout=0.0, grazing_dropout=0.0, colour_levels=0.0)

Flaw: TypeAlias = Callable[[Sequence[Frame], np.random.Generator], list[Frame]]
Row: TypeAlias = tuple[float, float, float, float]
"""Covered, stray, without a reading and wrong [%]."""


def main(options: Sequence[str] = ()) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    seeds: int = parser.parse_args(list(options)).seeds
    flaws: dict[str, Flaw] = {"none": lambda frames, _: list(frames)}
    flaws |= {"glitter": glittering, "flying": flying, "flicker": flickering}
    for name, flaw in flaws.items():
        table = Table("way", "covered [%]", "stray [%]", "no reading [%]", "wrong [%]", "failed")
        table.title = f"{name}; means of {seeds} seeds"
        rows = [_rows(seed, flaw) for seed in range(seeds)]
        for way in rows[0]:
            known = [row for row in (each[way] for each in rows) if row is not None]
            means = np.array(known).mean(axis=0) if known else np.full(4, np.nan)
            table.add_row(way, *(f"{value:.2f}" for value in means), f"{len(rows) - len(known)} of {len(rows)}")
        Console(width=110).print(table)


def glittering(frames: Sequence[Frame], rng: np.random.Generator) -> list[Frame]:
    """Patches of a third of the object's pixels, elsewhere in each image, without a reading."""
    found: list[Frame] = []
    for frame in frames:
        (mask,) = TASK.perception.segmenting.masks(frame.color)
        dots = (rng.random(mask.shape) < -np.log(1 - _GLITTER) / _PATCH**2).astype(np.uint8)
        holes = mask & (cv2.dilate(dots, np.ones((_PATCH, _PATCH), np.uint8)) > 0)
        found.append(replace(frame, depth=np.where(holes, 0, frame.depth).astype(np.uint16)))
    return found


def flying(frames: Sequence[Frame], rng: np.random.Generator) -> list[Frame]:
    """Half of the pixels at edges of depth report something between both sides."""
    found: list[Frame] = []
    for frame in frames:
        solid, near = frame.depth.astype(np.float32), nearest(frame.depth).astype(np.float32)
        far = cv2.dilate(solid, np.ones((3, 3)))
        edge = (far - near > _EDGE_M / frame.camera.depth_unit_m) & (near > 0) & (rng.random(solid.shape) < _MIXED)
        mixed = near + rng.random(solid.shape) * (far - near)
        found.append(replace(frame, depth=np.where(edge, mixed, solid).astype(np.uint16)))
    return found


def flickering(frames: Sequence[Frame], _: np.random.Generator) -> list[Frame]:
    """A band across each image is dark."""
    found: list[Frame] = []
    for frame in frames:
        color = frame.color.copy()
        color[_BAND] = (_DIM * color[_BAND]).astype(np.uint8)
        found.append(replace(frame, color=color))
    return found


def _rows(seed: int, flaw: Flaw) -> dict[str, Row | None]:
    home = pointing_down(np.array(HOME_TOOL_M))
    nodes = TASK.start(seed) + np.array([0.0, 0.0, _HELD_M if flaw is flying else 0.0])
    snapshot = Snapshot(time_s=0.0, nodes=nodes, tool=home, joints=solve_joints(home))
    rng = np.random.default_rng([seed, 3])
    before = photographed(TASK.stage, snapshot, rng, time_s=0.0)
    now = flaw(photographed(TASK.stage, snapshot, rng, time_s=1.0), rng)
    how = replace(TASK.perception, underside="thin") if flaw is flying else TASK.perception
    memory = reconstruct(before, how).memory
    steady = [filter_depth(frame, former) for frame, former in zip(now, before, strict=True)]
    ways: dict[str, tuple[list[Frame], Reconstruction, PriorKnowledge, list[Frame]]] = {
        "nothing": (now, replace(how, edge_step_m=10.0), PriorKnowledge(), now),
        "+ edges rejected": (now, how, PriorKnowledge(), now),
        "+ agreement with the frame before": (now, how, PriorKnowledge(before=tuple(before)), steady),
        "+ memory": (now, how, PriorKnowledge(before=tuple(before), memory=memory), steady),
    }
    return {name: _scored(frames, way, known, used, snapshot) for name, (frames, way, known, used) in ways.items()}


def _scored(
    frames: list[Frame], how: Reconstruction, known: PriorKnowledge, used: list[Frame], snapshot: Snapshot
) -> Row | None:
    try:
        seen = reconstruct(frames, how, known=known)
    except PerceptionError:
        return None
    tube = Tube(curve=snapshot.nodes, radius_m=TASK.rope.radius_m)
    truth = tube.samples(3000, np.random.default_rng(0))
    covered = (KDTree(seen.positions).query(truth)[0] < _NEAR_M).mean()
    stray = (tube.outside(seen.surface) > _STRAY_M).mean()
    return (100 * float(covered), 100 * float(stray), *_pixels(used, snapshot))


def _pixels(frames: list[Frame], snapshot: Snapshot) -> tuple[float, float]:
    """Shares of the pixels on the rope and up to 5 beside it [%]: without a reading, and wrong."""
    lost, wrong, count = 0, 0, 0
    for frame, camera in zip(frames, table_cameras(), strict=True):
        color, exact = render(snapshot, camera, np.random.default_rng(0), stage=TASK.stage, noise=_PERFECT)
        (mask,) = TASK.perception.segmenting.masks(color)
        near = cv2.dilate(mask.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0
        read = frame.depth[near].astype(float) * camera.depth_unit_m
        lost += int((read == 0).sum())
        wrong += int(((read > 0) & (np.abs(read - exact[near] * camera.depth_unit_m) > JUMP_M)).sum())
        count += int(near.sum())
    return 100 * lost / count, 100 * wrong / count


if __name__ == "__main__":
    main(sys.argv[1:])
