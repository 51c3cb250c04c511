"""A liquid, with pieces or without, that is poured at random from the held bowl into the fixed one, some at a time."""

from typing import Any, final

import numpy as np

from app.core.geometry.bowls import centre_of_bowl
from app.core.geometry.scene_description import Liquid, Soup
from app.core.geometry.track import Track
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.policy.random_pours import WATER_FURTHER_RAD, beside, pour_design, random_pour
from app.policy.random_pushes import PushDesign
from app.rig.simulated.kinds.liquid import fill_bowl, liquid_in_bowls
from app.rig.simulated.testbeds.base import Before, Testbed
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.liquid_world import LiquidWorld
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.world import Nodes
from app.tasks.elements.base import Task

_CLEAR_M = 0.02
"""Least distance of the two bowls, however the held one is turned."""
_HELD = 0.97
"""Share of its largest lean from which a bowl is held tilted."""


@final
class BowlPours(Testbed):
    """Pours from the held bowl, which stays in the hand; each episode begins with all of the liquid in it.

    `further_rad`: see `random_pour`.
    """

    holds = True
    in_hand = True

    def __init__(self, further_rad: tuple[float, float] = WATER_FURTHER_RAD) -> None:
        self._further_rad = further_rad

    def body(self, task: Task) -> Liquid | Soup:
        """The liquid."""
        return liquid_in_bowls(task.stage).liquid

    def design(self, episodes: int, pushes: int) -> PushDesign:
        """So many motions of the bowl."""
        return pour_design(episodes, pushes)

    def lay(
        self,
        task: Task,
        start: Nodes,
        before: Before | None,
        physics: WorldPhysics,
        intrusion: Intrusion,
        time_s: float,
    ) -> LiquidWorld:
        """The liquid in the bowl at one side of the fixed one, which follows from where the task begins."""
        del before
        bowls = liquid_in_bowls(task.stage)
        home = centre_of_bowl(start, bowls.held.radius_m, bowls.liquid.volume_m3)
        begin = _begin(task, home)
        stage, moved = fill_bowl(task.stage, start + (begin[:3] - home), intrusion.more)
        return LiquidWorld(stage, moved, physics=physics, intrusion=intrusion, time_s=time_s)

    def draw_track(
        self,
        task: Task,
        rng: np.random.Generator,
        nodes: Nodes,
        plan: PushDesign,
        *,
        start_s: float,
        tool: ToolPose | None = None,
    ) -> Track:
        """See `random_pour`."""
        del plan
        bowls = liquid_in_bowls(task.stage)
        assert tool is not None, "the bowl is in the hand"
        held = np.linalg.norm(nodes - tool[:3], axis=1) < bowls.held.radius_m + bowls.held.thickness_m
        x, y, _ = bowls.fixed.place_m
        motion = random_pour(
            rng,
            np.array([*tool[:2], _height_m(task)]),
            (x, y),
            volume_m3=float(held.mean()) * bowls.liquid.volume_m3,
            radius_m=bowls.held.radius_m,
            further_rad=self._further_rad,
        )
        return motion.track(start_s=start_s)

    def midway_s(self, command: Track) -> float:
        """The moment at which the bowl is turned back."""
        # Cosine of its lean: the z axis of a tool that is not tilted points down.
        _, x, y, _ = command.poses[:, 3:7].T
        lean = np.arccos(np.clip(2 * (x**2 + y**2) - 1, -1, 1))
        return float(command.times_s[np.flatnonzero(lean >= _HELD * lean.max())[-1]])

    def describe(self, physics: WorldPhysics, start: Nodes) -> dict[str, Any]:
        """Bulk modulus [Pa] of the liquid, and number of its drops, those that pieces are made of among them."""
        return {"bulk_pa": physics.bulk_pa, "drops": len(start)}


def _begin(task: Task, home: np.ndarray) -> ToolPose:
    """Pose of the bowl before its first motion, at an angle about the fixed one that is drawn with `home` [m]."""
    x, y, _ = liquid_in_bowls(task.stage).fixed.place_m
    aside = home[:2] - np.array([x, y])
    angle = float(2 * np.pi * np.modf(1e4 * np.abs(aside).sum())[0])
    return pointing_down(np.array([*beside((x, y), angle), _height_m(task)]))


def _height_m(task: Task) -> float:
    """Height of the held bowl's centre [m]."""
    _, held, fixed = liquid_in_bowls(task.stage)
    return fixed.place_m[2] + held.radius_m + held.thickness_m + _CLEAR_M


TESTBED = BowlPours()
