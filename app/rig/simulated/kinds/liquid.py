"""A liquid that is poured from a held bowl into a fixed one."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from app.core.geometry.bowls import centre_of_bowl, refill
from app.core.geometry.scene_description import Liquid, Soup, Stage
from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.kind import Kind
from app.rig.simulated.worlds.physics import LIQUID_WORLD, WorldPhysics
from app.rig.simulated.worlds.shapes import Surface, drops
from app.rig.simulated.worlds.world import Nodes, World

OVERLAP = 0.70
"""Radius of a drawn drop in spacings: the visible centre of a pool of them is within 1 mm of its level."""


class Bowls(NamedTuple):
    """A liquid, with pieces or without, the bowl in the hand that it is in at first, and the fixed one."""

    liquid: Liquid | Soup
    held: HeldBowl
    fixed: Bowl


def liquid_in_bowls(stage: Stage) -> Bowls:
    """The stage's liquid and bowls; TypeError for other objects or tools."""
    fixed = [each for each in stage.fixtures if isinstance(each, Bowl)]
    if not isinstance(stage.tool, HeldBowl) or len(fixed) != 1:
        raise TypeError(f"A liquid is poured from one bowl into another, not by a {type(stage.tool).__name__}.")
    if not isinstance(stage.body, Liquid | Soup):
        raise TypeError(f"{type(stage.body).__name__} is not a liquid.")
    return Bowls(liquid=stage.body, held=stage.tool, fixed=fixed[0])


def _node_count(stage: Stage) -> int:
    return _liquid(stage).drops


def build(
    stage: Stage,
    start: Nodes,
    time_s: float,
    /,
    *,
    physics: WorldPhysics | None = None,
    intrusion: Intrusion | None = None,
) -> World:
    """A world of liquids, with more or less in the held bowl at first where that is hidden."""
    from app.rig.simulated.worlds.liquid_world import LiquidWorld  # Other worlds' processes must not load JAX and Warp.

    if intrusion is not None:
        stage, start = fill_bowl(stage, start, intrusion.more)
    return LiquidWorld(stage, start, physics=physics or LIQUID_WORLD, intrusion=intrusion, time_s=time_s)


def fill_bowl(stage: Stage, start: Nodes, more: float) -> tuple[Stage, Nodes]:
    """The stage, and its liquid at rest in the held bowl, where there is more of it by a share of all."""
    if more == 0.0:
        return stage, start
    liquid, held, _ = liquid_in_bowls(stage)
    centre, more_of_it = (
        centre_of_bowl(start, held.radius_m, liquid.volume_m3),
        liquid.with_more(more * liquid.volume_m3),
    )
    nodes = refill(start, centre, held.radius_m, liquid.volume_m3, more_of_it.volume_m3)
    return replace(stage, body=more_of_it), nodes


def _surfaces(stage: Stage, nodes: Nodes) -> list[Surface]:
    return [pool(_liquid(stage), nodes)]


def pool(liquid: Liquid, nodes: Nodes) -> Surface:
    """Surface of the liquid at `nodes`."""
    return drops(nodes, OVERLAP * float(np.cbrt(liquid.volume_m3 / len(nodes))), liquid.colour)


def home(stage: Stage, start: Nodes) -> ToolPose:
    """Pose of the held bowl in which the liquid rests."""
    if not (isinstance(stage.tool, HeldBowl) and isinstance(stage.body, Liquid | Soup)):
        raise TypeError(f"A liquid is poured from a held bowl, not from a {type(stage.tool).__name__}.")
    return pointing_down(centre_of_bowl(start, stage.tool.radius_m, stage.body.volume_m3))


def _liquid(stage: Stage) -> Liquid:
    if not isinstance(stage.body, Liquid):
        raise TypeError(f"{type(stage.body).__name__} is not a liquid.")
    return stage.body


KIND = Kind(body=Liquid, node_count=_node_count, build=build, surfaces=_surfaces, home=home)
