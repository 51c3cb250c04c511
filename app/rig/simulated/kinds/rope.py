"""A rope, or a rigid rod of its size, that a finger pushes over the table."""

from app.core.stage import Rope, Stage
from app.rig.simulated.kind import Kind
from app.rig.simulated.physics import WorldPhysics
from app.rig.simulated.rope_world import RopeWorld
from app.rig.simulated.shapes import Surface, tube
from app.rig.simulated.world import Nodes


def _node_count(stage: Stage) -> int:
    del stage
    return WorldPhysics().rope.segments + 1


def _build(stage: Stage, start: Nodes, time_s: float) -> RopeWorld:
    return RopeWorld(stage.body, stage.tool, start, fixtures=stage.fixtures, time_s=time_s)


def _surfaces(stage: Stage, nodes: Nodes) -> list[Surface]:
    return [tube(nodes, stage.body.radius_m, stage.body.colour)]


KIND = Kind(body=Rope, node_count=_node_count, build=_build, surfaces=_surfaces)
