"""Reconstruction of partly hidden objects: `dipac bench occlusion --seeds 5`.

A board that the hand carries 10 cm over the table hides a share of the object from all cameras at once: 0, 20 or 40 %
of its volume. It is as large as that takes. It is grey, or has the object's own colour, as labels may. Before, the
object was seen whole; meanwhile it lay still, or all of it was moved by 8 mm.

Chamfer: root of half the symmetric squared distance between the particles and as many that fill the truth. Covered:
the share of the truth within 8 mm of a particle.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, final

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree

from app.core.errors import PerceptionError
from app.core.geometry.arm_geometry import ArmShape, JointState, LinkCapsule
from app.core.geometry.camera import CameraModel
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.scene_description import Stage
from app.core.geometry.shapes.base import Colour, Vector
from app.core.geometry.shapes.fixtures import Obstacle
from app.core.messages import Frame, fresh_id
from app.core.motion import pointing_down
from app.core.types import Cloud, Points
from app.perception.cloud.occlusion_memory import Memory
from app.perception.reconstruct import PriorKnowledge, Reconstruction, reconstruct
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.physics import HOME_TOOL_M
from app.rig.simulated.worlds.world import Snapshot
from app.tasks import Task, load

_SHARES = (0.0, 0.2, 0.4)
_TASKS = ("rope_push", "bean_sweep")
_NEAR_M = 0.008
_OVER_M, _THICK_M = 0.10, 0.012
_ROUNDS = 12
_SITUATIONS = (("grey", 0.0), ("the object's", 0.0), ("the object's", 0.008))
"""The board's colour, and the object's displacement under it [m]."""
_TRUTH = 4000
_GREY: Colour = (0.30, 0.32, 0.36)

Ways: TypeAlias = dict[str, Points | None]
"""The particles that each way of seeing makes; None where it sees too little."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """The object before and now, and the board over it."""

    task: Task
    before: Snapshot
    now: Snapshot
    board: Obstacle | None
    hidden: float


def main(options: Sequence[str] = ()) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    seeds: int = parser.parse_args(list(options)).seeds
    output = Console(width=130)
    for name in _TASKS:
        for colour, moved_m in _SITUATIONS:
            output.print(_table(load(name), colour, moved_m, range(seeds)))


def _table(task: Task, colour: str, moved_m: float, seeds: Sequence[int]) -> Table:
    table = Table("hidden", "way", "Chamfer [mm] median", "worst", "covered [%] median", "worst", "failed")
    table.title = f"{task.name}, moved {1e3 * moved_m:.0f} mm, colour of the board: {colour}; {len(seeds)} seeds"
    for share in _SHARES:
        rows = dict[str, list[tuple[float, float] | None]]()
        hidden = list[float]()
        for seed in seeds:
            shown = scene(task, seed, share, colour, moved_m)
            hidden.append(shown.hidden)
            truth = task.particles(shown.now.nodes, _TRUTH)
            for way, seen in ways(shown, seed).items():
                rows.setdefault(way, []).append(None if seen is None else scored(seen, truth, task, shown.now))
        for way, scores in rows.items():
            table.add_row(f"{100 * float(np.mean(hidden)):.0f} %", way, *_summed(scores))
        table.add_section()
    return table


def scored(seen: Points, truth: Points, task: Task, now: Snapshot) -> tuple[float, float]:
    """Chamfer distance [mm] and the share of the truth that is covered."""
    even = task.particles(now.nodes, len(seen))
    near = KDTree(seen).query(truth)[0] < _NEAR_M
    return 1e3 * float(np.sqrt(chamfer_m2(seen, even) / 2)), float(near.mean())


def _summed(scores: Sequence[tuple[float, float] | None]) -> list[str]:
    known = np.array([score for score in scores if score is not None])
    failed = f"{len(scores) - len(known)} of {len(scores)}"
    if not len(known):
        return ["-"] * 4 + [failed]
    chamfer, covered = known.T
    return [
        f"{np.median(chamfer):.2f}",
        f"{chamfer.max():.2f}",
        f"{100 * np.median(covered):.1f}",
        f"{100 * covered.min():.1f}",
        failed,
    ]


def ways(scene: Scene, seed: int) -> Ways:
    """The same frames seen in each way."""
    how = scene.task.perception
    rng = np.random.default_rng([seed, 7])
    before = photographed(scene.task.stage, scene.before, rng, time_s=0.0)
    now = photographed(_with_board(scene.task.stage, scene.board), scene.now, rng, time_s=1.0)
    at = JointState(joints=scene.now.joints, tool=scene.now.tool)
    masked = PriorKnowledge(arm=_arm(scene), postures=(at,) * len(now))
    blind = replace(how, depth=False)
    return {
        "nothing": _seen(now, how, PriorKnowledge()),
        "mask": _seen(now, how, masked),
        "mask + tracking": _seen(now, how, replace(masked, memory=_first(before, how, scene))),
        "hull": _seen(now, blind, masked),
        "hull + tracking": _seen(now, blind, replace(masked, memory=_first(before, blind, scene))),
    }


def _first(frames: Sequence[Frame], how: Reconstruction, scene: Scene) -> Memory:
    """Memory from the view before, when there was no board."""
    at = JointState(joints=scene.before.joints, tool=scene.before.tool)
    known = PriorKnowledge(arm=known_arm(scene.task.stage.tool), postures=(at,) * len(frames))
    return reconstruct(frames, how, known=known).memory


def _seen(frames: Sequence[Frame], how: Reconstruction, known: PriorKnowledge) -> Points | None:
    try:
        return reconstruct(frames, how, known=known).positions
    except PerceptionError:
        return None


def photographed(stage: Stage, snapshot: Snapshot, rng: np.random.Generator, *, time_s: float) -> list[Frame]:
    """Images of the cameras."""
    frames: list[Frame] = []
    for camera in table_cameras():
        color, depth = render(snapshot, camera, rng, stage=stage)
        frames.append(Frame(id=fresh_id("frame"), time_s=time_s, camera=camera, color=color, depth=depth))
    return frames


def scene(task: Task, seed: int, share: float, colour: str, moved_m: float) -> Scene:
    """The object of a seed, whole, and then behind a board that hides the share of it."""
    nodes = task.start(seed)
    rng = np.random.default_rng(seed)
    home = pointing_down(np.array(HOME_TOOL_M))
    before = Snapshot(time_s=0.0, nodes=nodes, tool=home, joints=solve_joints(home))
    turn = rng.uniform(0, 2 * np.pi)
    now = replace(before, nodes=nodes + moved_m * np.array([np.cos(turn), np.sin(turn), 0.0]))
    tone = _GREY if colour == "grey" else task.stage.body.colour
    board, hidden = _board(task, now, share, rng, tone)
    return Scene(task=task, before=before, now=now, board=board, hidden=hidden)


def _board(
    task: Task, snapshot: Snapshot, share: float, rng: np.random.Generator, colour: Colour
) -> tuple[Obstacle | None, float]:
    """The square board that hides the share of the object from every camera, and the hidden share."""
    if share == 0:
        return None, 0.0
    points = task.particles(snapshot.nodes, _TRUTH)
    x, y, _ = (float(number) for number in points[rng.integers(len(points))])
    low, high = 0.0, 0.4
    for _ in range(_ROUNDS):
        half = (low + high) / 2
        low, high = (half, high) if _hidden(_square(half, (x, y), colour), points) < share else (low, half)
    board = _square(high, (x, y), colour)
    return board, _hidden(board, points)


def _square(half: float, at: tuple[float, float], colour: Colour) -> Obstacle:
    return Obstacle(half_m=(half, half, _THICK_M / 2), place_m=(*at, _OVER_M), colour=colour)


def _hidden(board: Obstacle, points: Cloud) -> float:
    """The share of the points that no camera sees for it."""
    return float(np.all([_hides(board, camera, points) for camera in table_cameras()], axis=0).mean())


def _hides(board: Obstacle, camera: CameraModel, points: Cloud) -> np.ndarray:
    """Mask of the points behind the board: the ray from the camera to them crosses its middle plane within it."""
    eye = camera.T_world_camera[:3, 3]
    along = (board.place_m[2] - eye[2]) / (points[:, 2] - eye[2])
    crossing = eye[:2] + along[:, None] * (points[:, :2] - eye[:2])
    return np.all(np.abs(crossing - board.place_m[:2]) < board.half_m[:2], axis=1)


def _with_board(stage: Stage, board: Obstacle | None) -> Stage:
    return stage if board is None else replace(stage, fixtures=(*stage.fixtures, board))


def _arm(scene: Scene) -> ArmShape:
    """The arm as perception knows it, with capsules across the board."""
    arm = known_arm(scene.task.stage.tool)
    return arm if scene.board is None else replace(arm, limbs=(*arm.limbs, *slats(scene.board)))


def slats(board: Obstacle) -> Iterator[LinkCapsule]:
    """The board as capsules side by side."""
    (x, y, z), (wide, long, thick) = board.place_m, board.half_m
    count = int(np.ceil(long / thick))
    for at in np.linspace(y - long + thick, y + long - thick, count + 1):
        begin: Vector = (x - wide + thick, float(at), z)
        yield LinkCapsule(link=0, begin=begin, end=(x + wide - thick, float(at), z), radius_m=thick * 2**0.5)


if __name__ == "__main__":
    main(sys.argv[1:])
