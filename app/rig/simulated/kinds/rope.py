"""A rope, or a rigid rod of its size, that a finger pushes over the table."""

from app.core.geometry.scene_description import Rope, Stage
from app.core.geometry.shapes.fixtures import Obstacle
from app.core.geometry.shapes.tools import Finger
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.kind import Kind
from app.rig.simulated.worlds.physics import ROPE_WORLDS, WorldPhysics
from app.rig.simulated.worlds.rope_world import RopeWorld
from app.rig.simulated.worlds.shapes import Surface, tube
from app.rig.simulated.worlds.world import Nodes


def _of(stage: Stage) -> tuple[Rope, Finger]:
    """The rope and the finger; TypeError for another tool."""
    if not isinstance(stage.body, Rope) or not isinstance(stage.tool, Finger):
        raise TypeError(f"A Rope is pushed with a Finger, not with a {type(stage.tool).__name__}.")
    return stage.body, stage.tool


def _physics(stage: Stage) -> WorldPhysics:
    return ROPE_WORLDS[_of(stage)[0].model]


def _node_count(stage: Stage) -> int:
    return _physics(stage).segments + 1


def _build(
    stage: Stage,
    start: Nodes,
    time_s: float,
    /,
    *,
    physics: WorldPhysics | None = None,
    intrusion: Intrusion | None = None,
) -> RopeWorld:
    blocks = [each for each in stage.fixtures if isinstance(each, Obstacle)]
    rope, finger = _of(stage)
    own = physics or _physics(stage)
    return RopeWorld(rope, finger, start, physics=own, fixtures=blocks, intrusion=intrusion, time_s=time_s)


def _surfaces(stage: Stage, nodes: Nodes) -> list[Surface]:
    rope, _ = _of(stage)
    return [tube(nodes, rope.radius_m, rope.colour)]


KIND = Kind(body=Rope, node_count=_node_count, build=_build, surfaces=_surfaces)
