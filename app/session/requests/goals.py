"""Goals requested while the program runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final, final

import numpy as np

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import GoalRequest, GoalSource, PictureGoalRequest
from app.core.errors import DipacError, UsageError
from app.core.geometry.camera import CameraModel
from app.core.messages import Frame, Goal, Model, fresh_id
from app.core.ports import Clock, Computer
from app.core.types import Cloud
from app.jobs.goals import goal_of
from app.jobs.worker_api import shown_goal
from app.perception.reconstruct import Reconstruction, reconstruct
from app.tasks.elements.base import EpisodeConfig

_CALLED: Final[Mapping[GoalSource, str]] = {
    "view": "The current view as goal",
    "curve": "The drawn goal",
    "copy": "The moved copy as goal",
    "region": "The region as goal",
    "file": "The goal of the file",
}


@final
class Aiming:
    """Conversion of goal requests to episode configurations; failures are announced."""

    def __init__(
        self, cameras: Mapping[str, CameraModel], perceiver: Computer, site: Site, announcer: MessageBus, clock: Clock
    ) -> None:
        self._announcer, self._clock, self._site = announcer, clock, site
        self._perceiver, self._cameras = perceiver, cameras

    async def choose_goal(
        self, config: EpisodeConfig, request: GoalRequest | PictureGoalRequest, how: Reconstruction, model: Model | None
    ) -> EpisodeConfig | None:
        """The configuration with the requested goal, which has been published; None if it is invalid.

        `how`: perception settings for pictures; `model`: its errors of cameras move the goal that they show.
        """
        try:
            name, points = await self._points(request, how)
            box, count = self._site.limits.workspace, config.task.preset(config.preset).particle_count
            positions = await self._perceiver.run(goal_of, config.task.name, points, count, box, name)
            goal = Goal(id=fresh_id("goal"), cause=(request.id,), time_s=self._clock.now(), positions=positions)
            errs = model is not None and model.apparatus
            shown = await self._perceiver.run(shown_goal, positions, model) if errs else None
        except DipacError as error:
            self._announcer.notice("goal", str(error), request.id)
            return None
        self._announcer.say(goal)
        self._announcer.notice("goal", f"{name} is set by {request.operator}.", request.id)
        return replace(config, goal=goal, shown_goal=shown)

    async def _points(self, request: GoalRequest | PictureGoalRequest, how: Reconstruction) -> tuple[str, Cloud]:
        """Name of the request, and its points [m]. Raises DipacError if a picture shows no object."""
        if isinstance(request, GoalRequest):
            return _CALLED[request.source], request.positions
        frame = _frame(request, self._cameras)
        seen = await self._perceiver.run(reconstruct, [frame], how)
        return f"The goal of the pictures for camera {request.camera!r}", seen.positions


def _frame(request: PictureGoalRequest, cameras: Mapping[str, CameraModel]) -> Frame:
    """The pictures as if that camera had just taken them. Raises UsageError where they are not its own."""
    camera = cameras.get(request.camera)
    if camera is None:
        raise UsageError.unknown("camera", request.camera, cameras)
    expected = (camera.height, camera.width)
    if request.color.shape[:2] != expected or request.depth.shape != expected:
        sizes = [f"{image.shape[1]} x {image.shape[0]}" for image in (request.color, request.depth)]
        raise UsageError(
            f"The pictures are {sizes[0]} and {sizes[1]} pixels; those of camera {camera.name!r} are "
            f"{camera.width} x {camera.height}: take both with it."
        )
    if not np.any(request.depth):
        raise UsageError("The depth picture has no reading; give the 16-bit one, in the camera's depth unit.")
    return Frame(id=fresh_id("frame"), time_s=request.time_s, camera=camera, color=request.color, depth=request.depth)
