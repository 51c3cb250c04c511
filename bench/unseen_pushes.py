"""A push that no camera sees: what is remembered stays, or goes with the tool: `dipac bench unseen_pushes`.

A finger pushes the middle of a rope over 60 mm, a paddle sweeps beans over as much, in the MuJoCo world; a board of
20 cm that the hand carries hides the place from both cameras. It is looked at four times on the way. Root of half the
symmetric squared Chamfer distance to the truth at the end [mm], of three ways of seeing: the arm masked, with what is
hidden kept where it was, and with what the tool pushes carried.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table

from app.core.geometry.arm_geometry import JointState
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.shapes.fixtures import Obstacle
from app.core.types import ToolPose
from app.perception.reconstruct import PriorKnowledge, Reconstructed, reconstruct
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.limbs import known_arm
from app.rig.simulated.worlds.world import Snapshot, World
from app.tasks import Task, load
from bench.occlusion import photographed, slats

Errors: TypeAlias = dict[str, float]
"""Errors of each reconstruction method [mm]."""

_BEFORE_M, _BEYOND_M = 0.03, 0.06
_LOOKS, _STEPS = 4, 5
_HALF_BOARD_M, _OVER_M = 0.10, 0.10
_HIGH_M = 0.15


def main(options: Sequence[str] = ()) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    seeds: int = parser.parse_args(list(options)).seeds
    table = Table("task", "way", "median [mm]", "worst")
    for name, measure in (("rope_push", pushed_rope), ("bean_sweep", swept_beans)):
        errors = [measure(seed) for seed in range(seeds)]
        for way in errors[0]:
            values = [each[way] for each in errors]
            table.add_row(name, way, f"{np.median(values):.1f}", f"{max(values):.1f}")
    Console(width=100).print(table)


def pushed_rope(seed: int) -> Errors:
    """Errors for a push across the rope at its middle."""
    task = load("rope_push")
    world = _world(task, seed)
    nodes = world.nodes()
    middle, along = nodes[len(nodes) // 2], nodes[len(nodes) // 2 + 1] - nodes[len(nodes) // 2 - 1]
    ahead = np.array([-along[1], along[0]]) / np.hypot(along[0], along[1])
    return _pushed(task, world, seed, middle[:2], ahead, task.finger.push_height_m)


def swept_beans(seed: int) -> Errors:
    """Errors for a sweep along y, over one of the beans."""
    task = load("bean_sweep")
    world = _world(task, seed)
    middle = np.random.default_rng(seed).choice(world.nodes())
    return _pushed(task, world, seed, middle[:2], np.array([0.0, 1.0]), 0.0215)


def _world(task: Task, seed: int) -> World:
    kind, start = kind_of(task.stage), task.start(seed)
    home = kind.home(task.stage, start)
    world = kind.build(task.stage, start, 0.0)
    world.place(home)
    world.step(home, 1.0)
    return world


def _pushed(
    task: Task, world: World, seed: int, over: Float64[np.ndarray, "2"], ahead: Float64[np.ndarray, "2"], z: float
) -> Errors:
    rng = np.random.default_rng(seed)
    whole = _look(task, world.snapshot(), rng, board=False, known=PriorKnowledge())
    world.step(_at(world.tool, over - _BEFORE_M * ahead, _HIGH_M), 1.0)
    world.step(_at(world.tool, over - _BEFORE_M * ahead, z), 0.7)
    way, masked, stayed, went = [world.tool.copy()], whole, whole, whole
    for _ in range(_LOOKS):
        way = way[-1:]
        for _ in range(_STEPS):
            step = (_BEFORE_M + _BEYOND_M) / (_LOOKS * _STEPS) * ahead
            world.step(_at(world.tool, world.tool[:2] + step, z), 0.03)
            way.append(world.tool.copy())
        snapshot = world.snapshot()
        masked = _look(task, snapshot, rng, board=True, known=PriorKnowledge())
        stayed = _look(task, snapshot, rng, board=True, known=PriorKnowledge(memory=stayed.memory))
        went = _look(task, snapshot, rng, board=True, known=PriorKnowledge(memory=went.memory, way=np.array(way)))
    truth = task.particles(world.nodes(), task.perception.particle_count)
    ways = {"mask": masked, "kept": stayed, "carried": went}
    return {name: 1e3 * float(np.sqrt(chamfer_m2(each.positions, truth) / 2)) for name, each in ways.items()}


def _at(tool: ToolPose, xy: Float64[np.ndarray, "2"], z: float) -> ToolPose:
    pose = tool.copy()
    pose[:3] = [*xy, z]
    return pose


def _look(
    task: Task, snapshot: Snapshot, rng: np.random.Generator, *, board: bool, known: PriorKnowledge
) -> Reconstructed:
    """Reconstruct with the arm known, and the board if it carries one."""
    stage, arm = task.stage, known_arm(task.stage.tool)
    if board:
        half = (_HALF_BOARD_M, _HALF_BOARD_M, 0.006)
        over = Obstacle(half_m=half, place_m=(float(snapshot.tool[0]), float(snapshot.tool[1]), _OVER_M))
        stage = replace(stage, fixtures=(*stage.fixtures, over))
        arm = replace(arm, limbs=(*arm.limbs, *slats(over)))
    frames = photographed(stage, snapshot, rng, time_s=snapshot.time_s)
    posture = JointState(joints=snapshot.joints, tool=snapshot.tool)
    return reconstruct(frames, task.perception, known=replace(known, arm=arm, postures=(posture,) * len(frames)))


if __name__ == "__main__":
    main(sys.argv[1:])
