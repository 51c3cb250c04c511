"""The running application on one page: cameras -> particles -> model -> plan -> approval -> arm, and all begins again.

Every part runs all the time, in one task group, joined by channels that say what they do when a reader is slow; the
loop in the middle goes round (`loop.py`), and the session's state changes by rules (`rules.py`). What is heavy runs in
worker processes; STOP and jogging go from the console to the arm's process without passing here.
"""

from typing import final

import anyio
from anyio.abc import TaskGroup

from app.core.dialogue.checklist import ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, ModeRequest
from app.core.dialogue.requests import HandRequest
from app.core.dialogue.summary import Summary
from app.core.errors import DipacError, first_error
from app.core.messages import Decision, Notice, ResumeRequest, StopRequest
from app.session.parts import Parts
from app.session.requests.chores import Chores
from app.session.stages import SessionStages
from app.session.state import Failure, ModeChoice, ModelUpdate

_LAST_CALIBRATION_S = 300.0
"""Timeout at the end of an episode for learning from its last pushes."""


@final
class Session:
    """One session. Build it of its parts, `await run()`, read the summary."""

    def __init__(self, parts: Parts) -> None:
        self.parts = parts
        self.store, self.summary = parts.store, parts.summary
        self._stages = SessionStages(parts)
        self._chores = Chores(parts, self._stages)

    async def run(self) -> Summary:
        """Push until the goal is reached or the pushes are used up; if `staying`, until an operator ends it.

        Raises the first DipacError of any stage.
        """
        it = self.parts
        async with it.announcer.recording(), it.sensing.perceiver, it.planner, it.learning.calibrator:
            try:
                async with anyio.create_task_group() as stages:
                    for part in (it.sensing, it.learning, it.watching, it.calibrating, it.preflight, it.planning.ahead):
                        stages.start_soon(part.run)
                    stages.start_soon(self._listen)
                    stages.start_soon(it.reporting.run, it.sensing, it.learning, it.approving, it.store)
                    it.announcer.say(it.store.state.config.goal)
                    it.announcer.say(it.store.mode)
                    await self._work(stages)
                    stages.cancel_scope.cancel()
            except BaseExceptionGroup as group:
                error = first_error(group)
                it.announcer.end(error)
                raise error from group
        return self.summary

    async def _listen(self) -> None:
        """The operator's requests. The arm has stopped before a StopRequest gets here."""
        it = self.parts
        async for request in it.operator.requests():
            await it.announcer.room()  # However fast somebody asks, the log keeps up.
            it.announcer.say(request)
            match request:
                case Decision() | StopRequest() | EndRequest() | Lease() | HandRequest():
                    it.store.dispatch(request)
                case ModeRequest():
                    it.store.dispatch(ModeChoice(request, it.summary.pushes))
                case ResumeRequest():
                    await it.latch.resume(request)
                case ChecklistRequest():
                    await it.preflight.confirm(request)
                case Notice():
                    pass  # Saying it is all.
                case _:
                    self._chores.put(request)

    async def _work(self, stages: TaskGroup) -> None:
        """Go round until the session ends. What of it is done depends on the mode."""
        it, config = self.parts, self.store.state.config
        model = await it.planning.begin(config, it.reporting.do)
        self.store.dispatch(ModelUpdate(model, replaces=None))
        stages.start_soon(self._chores.run)
        stages.start_soon(it.planning.warm_up, config, model)
        while not self.store.state.ended:
            try:
                await self._stages.turn()
            except DipacError as error:
                if not config.staying:
                    raise
                it.announcer.fault("application", error)
                self.store.dispatch(Failure())
        it.reporting.do("finishing the calibration")
        with it.clock.move_on_after(_LAST_CALIBRATION_S):
            while it.learning.processed < it.learning.submitted or it.watching.processed < it.watching.submitted:
                await it.clock.sleep(it.site.timing.health_period_s)
        it.reporting.do("done")
