"""Transitions -> model, in the background and never in the way of planning."""

from typing import final

from app.config import Site
from app.core.announcer import Announcer
from app.core.channel import Latest, Lossless
from app.core.errors import DipacError
from app.core.messages import Model, Transition
from app.core.worker import Worker
from app.tasks.base import Wish
from app.tasks.jobs import update


@final
class Learning:
    """`models`: the one in use; `calibrator`: the process that fits it; `done`: transitions that were dealt with."""

    def __init__(self, wish: Wish, announcer: Announcer, site: Site) -> None:
        self.models = Latest[Model]("models")
        self.calibrator = Worker("calibrator", idle=True)  # A decision waits for the planner, nothing for this.
        self.done = self.put_in = 0
        self._wish, self._announcer, self._site = wish, announcer, site
        self._transitions = Lossless[Transition]("transitions", bound=100)

    async def put(self, transition: Transition) -> None:
        """Learn from this, soon."""
        self.put_in += 1
        await self._transitions.put(transition)

    async def run(self) -> None:
        """Transitions -> models, for ever."""
        seen: list[Transition] = []
        async for transition in self._transitions:
            seen.append(transition)
            if self._wish.calibrating and self.models.value is not None:
                await self._update(seen, self.models.value)
            self.done = len(seen)

    async def _update(self, seen: list[Transition], old: Model) -> None:
        try:
            wish = self._wish
            new = await self.calibrator.run(update, wish.task.name, wish.preset, seen, old, self._site)
        except DipacError as error:
            self._announcer.fault("calibration", error)
            return
        if self.models.value is old:  # Somebody chose another meanwhile: what was learned is not about that one.
            self.models.put(self._announcer.say(new))
