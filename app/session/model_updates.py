"""Models in use: those learned from transitions, in the background, and those that an operator asks for."""

from collections import deque
from dataclasses import replace
from typing import NamedTuple, final

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import ModelRequest
from app.core.errors import DipacError, UsageError
from app.core.messages import Model, Transition, fresh_id
from app.core.ports import Clock, Computer, Computers
from app.core.system.channel import Latest, Lossless
from app.core.system.worker import Worker
from app.core.types import Points
from app.jobs.worker_api import RECENT, check_model, planner_needs, shown_goal, update
from app.tasks.elements.base import EpisodeConfig


@final
class Learning:
    """`models`: the one in use; `calibrator`: the process that fits it, which is `busy` or not.

    `done` of the transitions that were `submitted` have been dealt with.
    """

    def __init__(
        self,
        config: EpisodeConfig,
        planner: Computer,
        site: Site,
        announcer: MessageBus,
        clock: Clock,
        computers: Computers = Worker,
    ) -> None:
        self.models = Latest[Model]("models")
        # A decision waits for the planner, only the end of an episode for this: a tenth of a core that all others want.
        self.calibrator = computers("calibrator", niceness=10)
        self.done, self.submitted, self.busy = 0, 0, False
        self._config, self._site = config, site
        self._announcer, self._clock = announcer, clock
        self._modelling = Modelling(config.task.name, announcer, planner)
        self._transitions = Lossless[Transition]("transitions", bound=100)

    def begin(self, model: Model) -> None:
        """Start with this model, which has been published."""
        self.models.put(self._modelling.numbered(model))

    @property
    def current(self) -> Model:
        """The model in use."""
        model = self.models.value
        assert model is not None, "warming up has said one"
        return model

    async def use(self, request: ModelRequest, goal: Points) -> tuple[Model, Points | None] | None:
        """Plan with the requested model, if it is valid, and continue to learn from it.

        Returns it, and where cameras that err show an object at the goal (M, 3) [m]; None where it is refused.
        """
        taken = await self._modelling.taken(request, self.current, goal, now_s=self._clock.now())
        if taken is None:
            return None
        self.models.put(self._announcer.say(taken.model))
        return taken.model, taken.shown_goal

    async def put(self, transition: Transition) -> None:
        """Learn from this, soon."""
        self.submitted += 1
        await self._transitions.put(transition)

    async def run(self) -> None:
        """Transitions -> models, for ever."""
        newest = deque[Transition](maxlen=RECENT)
        async for transition in self._transitions:
            newest.append(transition)
            if self._config.calibrating and self.models.value is not None:
                await self._update(tuple(newest), self.models.value)
            self.done += 1

    async def _update(self, newest: tuple[Transition, ...], old: Model) -> None:
        config, self.busy = self._config, True
        try:
            new = await self.calibrator.run(update, config.task.name, config.preset, newest, old, self._site)
        except DipacError as error:
            self._announcer.fault("calibration", error)
            return
        finally:
            self.busy = False
        if self.models.value is old:  # Where somebody chose another meanwhile, what was learned is not about that one.
            self.models.put(self._announcer.say(self._modelling.numbered(new)))


@final
class Taken(NamedTuple):
    """A model to say and to use, and where cameras that err show an object at the goal; None where they do not."""

    model: Model
    shown_goal: Points | None


@final
class Modelling:
    """Models of `task` in use, and their version numbers, which only grow, whoever made them."""

    def __init__(self, task: str, announcer: MessageBus, planner: Computer) -> None:
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
            before, after, shown = await self._check_model(request.model, current, goal)
        except DipacError as error:
            self._announcer.notice("model", f"The model of {request.source} is not used: {error}", request.id)
            return None
        asked = replace(request.model, id=fresh_id("model"), cause=(request.id, request.model.id), time_s=now_s)
        model = self.numbered(asked)
        self._announcer.notice("model", _notice_text(request, model) + _compiling(before, after), request.id)
        return Taken(model, shown)

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


def _notice_text(request: ModelRequest, model: Model) -> str:
    return f"{request.operator} chose the model of {request.source}; it is version {model.version} now."


def _compiling(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    """Expected compilation of the next plan, as text; empty if none."""
    if before == after:
        return ""
    simulated = ", ".join(after) or "nothing but the nominal physics"
    return f" It simulates {simulated}: the planner compiles anew, which takes minutes."
