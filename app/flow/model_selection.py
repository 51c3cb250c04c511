"""Models that an operator asks for: checked where the planner is, numbered, and ready to be planned with."""

from dataclasses import replace
from typing import NamedTuple, final

from app.core.announcer import MessageBus
from app.core.dialogue.requests import ModelRequest
from app.core.errors import DipacError, UsageError
from app.core.messages import Model, fresh_id
from app.core.system.worker import Worker
from app.core.types import Points
from app.jobs.worker_api import check_model, planner_needs, shown_goal


@final
class Taken(NamedTuple):
    """A model to say and to use, and where cameras that err show an object at the goal; None where they do not."""

    model: Model
    shown_goal: Points | None


@final
class Modelling:
    """Models of `task` in use, and their version numbers, which only grow, whoever made them."""

    def __init__(self, task: str, announcer: MessageBus, planner: Worker) -> None:
        self._task, self._announcer, self._planner = task, announcer, planner
        self._newest: int | None = None

    def numbered(self, model: Model) -> Model:
        """The model as the newest version; the first one keeps its number."""
        self._newest = model.version if self._newest is None else self._newest + 1
        return model if model.version == self._newest else replace(model, version=self._newest)

    async def taken(self, request: ModelRequest, current: Model, goal: Points, *, now_s: float) -> Taken | None:
        """The requested model as a new version, once the planner's process has found it sound.

        `current`: the model in use; `goal`: (M, 3) [m], where the object shall truly be. A return to an earlier version
        is a new one with its parameters, loss and transitions. None where it is refused, which is said in words. Waits
        for a plan that is being made.
        """
        try:
            before, after, shown = await self._checked(request.model, current, goal)
        except DipacError as error:
            self._announcer.notice("model", f"The model of {request.source} is not used: {error}", request.id)
            return None
        asked = replace(request.model, id=fresh_id("model"), cause=(request.id, request.model.id), time_s=now_s)
        model = self.numbered(asked)
        self._announcer.notice("model", _said(request, model) + _compiling(before, after), request.id)
        return Taken(model, shown)

    async def _checked(
        self, model: Model, current: Model, goal: Points
    ) -> tuple[tuple[str, ...], tuple[str, ...], Points | None]:
        """The planner's needs before and after, and the goal as shown. Raises DipacError for an invalid model."""
        if model.task != self._task:
            raise UsageError(f"It is of task {model.task!r}, not of {self._task!r}; choose one of this task.")
        run = self._planner.run
        await run(check_model, model)
        shown = await run(shown_goal, goal, model) if model.apparatus else None
        return await run(planner_needs, current), await run(planner_needs, model), shown


def _said(request: ModelRequest, model: Model) -> str:
    return f"{request.operator} chose the model of {request.source}; it is version {model.version} now."


def _compiling(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    """Expected compilation of the next plan, as text; empty if none."""
    if before == after:
        return ""
    simulated = ", ".join(after) or "nothing but the nominal physics"
    return f" It simulates {simulated}: the planner compiles anew, which takes minutes."
