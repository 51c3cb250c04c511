"""A cloth that a gripper carries."""

from app.core.geometry.scene_description import Cloth, Stage
from app.core.geometry.shapes.tools import Gripper
from app.rig.simulated.worlds.cloth_world import ClothWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.kind import Kind
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.shapes import Surface, sheet
from app.rig.simulated.worlds.world import Nodes


def cloth_and_gripper(stage: Stage) -> tuple[Cloth, Gripper]:
    """The cloth and the gripper; TypeError for another tool."""
    if not isinstance(stage.tool, Gripper):
        raise TypeError(f"A cloth is held by a Gripper, not by a {type(stage.tool).__name__}.")
    return _cloth(stage), stage.tool


def _node_count(stage: Stage) -> int:
    return _cloth(stage).nodes_a_side ** 2


def _build(
    stage: Stage,
    start: Nodes,
    time_s: float,
    /,
    *,
    physics: WorldPhysics | None = None,
    intrusion: Intrusion | None = None,
) -> ClothWorld:
    """The world of a cloth. Raises TypeError where the tool cannot hold one."""
    cloth, gripper = cloth_and_gripper(stage)
    return ClothWorld(
        cloth, gripper, start, fixtures=stage.fixtures, physics=physics, intrusion=intrusion, time_s=time_s
    )


def _surfaces(stage: Stage, nodes: Nodes) -> list[Surface]:
    return [sheet(nodes.reshape(_cloth(stage).nodes_a_side, -1, 3), _cloth(stage).colour)]


def _cloth(stage: Stage) -> Cloth:
    if not isinstance(stage.body, Cloth):
        raise TypeError(f"This is about a Cloth, not a {type(stage.body).__name__}.")
    return stage.body


KIND = Kind(body=Cloth, node_count=_node_count, build=_build, surfaces=_surfaces)
