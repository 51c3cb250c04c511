"""Models in use: those learned from transitions, in the background, and those that an operator asks for."""

from collections import deque
from dataclasses import replace
from typing import final

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import ModelRequest
from app.core.errors import DipacError, UsageError
from app.core.messages import Model, Transition, fresh_id
from app.core.ports import Clock, Computer, Computers
from app.core.system.channel import Lossless
from app.core.system.worker import Worker
from app.core.types import Points
from app.jobs.worker_api import RECENT, check_model, planner_needs, shown_goal, update
from app.session.state import ChosenModel, ModelUpdate
from app.session.store import SessionStore
from app.tasks.elements.base import EpisodeConfig


@final
class Learning:
    """Updates of the model in use; `calibrator`: the process that fits them, which is `busy` or not.

    `processed` of the transitions that were `submitted` have been dealt with.
    """

    def __init__(
        self,
        config: EpisodeConfig,
        site: Site,
        store: SessionStore,
        announcer: MessageBus,
        computers: Computers = Worker,
    ) -> None:
        # A decision waits for the planner, only the end of an episode for this: a tenth of a core that all others want.
        self.calibrator = computers("calibrator", niceness=10)
        self.processed, self.submitted, self.busy = 0, 0, False
        self._config, self._site, self._store, self._announcer = config, site, store, announcer
        self._transitions = Lossless[Transition]("transitions", bound=100)

    async def put(self, transition: Transition) -> None:
        """Learn from this, soon."""
        self.submitted += 1
        await self._transitions.put(transition)

    async def run(self) -> None:
        """Transitions -> models, for ever."""
        newest = deque[Transition](maxlen=RECENT)
        async for transition in self._transitions:
            newest.append(transition)
            if self._config.calibrating and self._store.state.model is not None:
                await self._update(tuple(newest), self._store.state.model)
            self.processed += 1

    async def _update(self, newest: tuple[Transition, ...], old: Model) -> None:
        config, self.busy = self._config, True
        try:
            new = await self.calibrator.run(update, config.task.name, config.preset, newest, old, self._site)
        except DipacError as error:
            self._announcer.fault("calibration", error)
            return
        finally:
            self.busy = False
        self._store.dispatch(ModelUpdate(new, replaces=old))


@final
class Modelling:
    """Models of `task` that an operator asks for."""

    def __init__(self, task: str, planner: Computer, announcer: MessageBus, clock: Clock) -> None:
        self._task, self._planner, self._announcer, self._clock = task, planner, announcer, clock

    async def chosen_model(self, request: ModelRequest, current: Model, goal: Points) -> ChosenModel | None:
        """The requested model, once the planner's process has found it sound; None if not, which is announced.

        `current`: the model in use; `goal`: (M, 3) [m], where the object shall truly be. A return to an earlier version
        is a new one with its parameters, loss and transitions. Waits for a plan that is being made.
        """
        now_s = self._clock.now()
        try:
            before, after, shown = await self._check_model(request.model, current, goal)
        except DipacError as error:
            self._announcer.notice("model", f"The model of {request.source} is not used: {error}", request.id)
            return None
        model = replace(request.model, id=fresh_id("model"), cause=(request.id, request.model.id), time_s=now_s)
        return ChosenModel(request, model, shown, _compiling(before, after))

    async def _check_model(
        self, model: Model, current: Model, goal: Points
    ) -> tuple[tuple[str, ...], tuple[str, ...], Points | None]:
        """The planner's needs before and after, and the goal as shown. Raises DipacError for an invalid model."""
        if model.task != self._task:
            raise UsageError(f"It is of task {model.task!r}, not of {self._task!r}; choose one of this task.")
        run = self._planner.run
        await run(check_model, model)
        shown = await run(shown_goal, goal, model) if model.apparatus else None
        return await run(planner_needs, current), await run(planner_needs, model), shown


def _compiling(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    """Expected compilation of the next plan, as text; empty if none."""
    if before == after:
        return ""
    simulated = ", ".join(after) or "nothing but the nominal physics"
    return f" It simulates {simulated}: the planner compiles anew, which takes minutes."
