"""Beans that a paddle sweeps over the table."""

from app.core.geometry.scene_description import Beans, Stage
from app.core.geometry.shapes.tools import Paddle
from app.rig.simulated.worlds.beans_world import BeansWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.kind import Kind
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.shapes import Surface, tube
from app.rig.simulated.worlds.world import Nodes


def beans_and_paddle(stage: Stage) -> tuple[Beans, Paddle]:
    """The beans and the paddle; TypeError for another tool."""
    if not isinstance(stage.body, Beans) or not isinstance(stage.tool, Paddle):
        raise TypeError(f"Beans are swept with a Paddle, not with a {type(stage.tool).__name__}.")
    return stage.body, stage.tool


def _node_count(stage: Stage) -> int:
    return 2 * beans_and_paddle(stage)[0].count


def _build(
    stage: Stage,
    start: Nodes,
    time_s: float,
    /,
    *,
    physics: WorldPhysics | None = None,
    intrusion: Intrusion | None = None,
) -> BeansWorld:
    return BeansWorld(*beans_and_paddle(stage), start, physics=physics, intrusion=intrusion, time_s=time_s)


def _surfaces(stage: Stage, nodes: Nodes) -> list[Surface]:
    beans, _ = beans_and_paddle(stage)
    return [tube(ends, beans.radius_m, beans.colour) for ends in nodes.reshape(-1, 2, 3)]


KIND = Kind(body=Beans, node_count=_node_count, build=_build, surfaces=_surfaces)
