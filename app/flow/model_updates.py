"""Transitions -> model, in the background and never in the way of planning."""

from collections import deque
from typing import final

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import ModelRequest
from app.core.errors import DipacError
from app.core.messages import Model, Transition
from app.core.ports import Clock
from app.core.system.channel import Latest, Lossless
from app.core.system.worker import Worker
from app.core.types import Points
from app.flow.model_selection import Modelling
from app.jobs.worker_api import RECENT, update
from app.tasks.elements.base import EpisodeConfig


@final
class Learning:
    """`models`: the one in use; `calibrator`: the process that fits it, which is `busy` or not.

    `done` of the transitions that were `submitted` have been dealt with.
    """

    def __init__(self, wish: EpisodeConfig, planner: Worker, site: Site, announcer: MessageBus, clock: Clock) -> None:
        self.models = Latest[Model]("models")
        # A decision waits for the planner, only the end of an episode for this: a tenth of a core that all others want.
        self.calibrator = Worker("calibrator", niceness=10)
        self.done, self.submitted, self.busy = 0, 0, False
        self._wish, self._site = wish, site
        self._announcer, self._clock = announcer, clock
        self._modelling = Modelling(wish.task.name, announcer, planner)
        self._transitions = Lossless[Transition]("transitions", bound=100)

    def begin(self, model: Model) -> None:
        """Start with this model, which has been published."""
        self.models.put(self._modelling.numbered(model))

    async def use(self, request: ModelRequest, goal: Points) -> tuple[Model, Points | None] | None:
        """Plan with the requested model, if it is valid, and continue to learn from it.

        Returns it, and where cameras that err show an object at the goal (M, 3) [m]; None where it is refused.
        """
        current = self.models.value
        assert current is not None, "there is a model before anybody can ask for another"
        taken = await self._modelling.taken(request, current, goal, now_s=self._clock.now())
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
            if self._wish.calibrating and self.models.value is not None:
                await self._update(tuple(newest), self.models.value)
            self.done += 1

    async def _update(self, newest: tuple[Transition, ...], old: Model) -> None:
        wish, self.busy = self._wish, True
        try:
            new = await self.calibrator.run(update, wish.task.name, wish.preset, newest, old, self._site)
        except DipacError as error:
            self._announcer.fault("calibration", error)
            return
        finally:
            self.busy = False
        if self.models.value is old:  # Where somebody chose another meanwhile, what was learned is not about that one.
            self.models.put(self._announcer.say(self._modelling.numbered(new)))
