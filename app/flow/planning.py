"""The planner's process: warmed up, asked for plans, and asked again where it fails."""

from collections.abc import Callable
from typing import final

from app.config import Site
from app.core.announcer import Announcer
from app.core.errors import PlanningError, WorkerError
from app.core.messages import Model, Particles, Proposal
from app.core.ports import Clock
from app.core.types import ToolPose
from app.core.worker import Worker
from app.flow.asking import Asking
from app.tasks.base import Wish
from app.tasks.jobs import nominal_model, plan, uncalibrated_model, warm_up_stage, warm_up_stages

FAILURES_IN_A_ROW = 3


@final
class Planning:
    """Makes proposals. What somebody asked for goes before what the planner would do."""

    def __init__(self, wish: Wish, planner: Worker, site: Site, announcer: Announcer, clock: Clock) -> None:
        self._announcer, self._clock = announcer, clock
        self._planner, self._site = planner, site
        self.asking = Asking(wish, announcer, planner, site)

    async def warm_up(self, wish: Wish, do: Callable[[str], None]) -> Model:
        """Compile what planning needs, each stage told to `do`; the model to begin with, which has been said."""
        planner, task, preset, method = self._planner, wish.task.name, wish.preset, wish.method
        do("starting the planner")
        known = nominal_model if method.calibrated else uncalibrated_model
        model = self._announcer.say(wish.model or await planner.run(known, task))
        for index, stage in enumerate(await planner.run(warm_up_stages, task, preset, model, method)):
            do(f"compiling {stage}")
            await planner.run(warm_up_stage, task, preset, index, model, method)
        return model

    def answered(self) -> None:
        """What was asked for has been decided on."""
        self.asking.answered()

    async def proposal(
        self, wish: Wish, observed: Particles, model: Model, tool: ToolPose, seeds: tuple[int, ...]
    ) -> Proposal:
        """A plan; where the planner fails, another with other random branches. The third error in a row is raised."""
        started_s, x, goal = self._clock.now(), observed.positions, wish.goal.positions
        for attempt in range(FAILURES_IN_A_ROW):
            seed = hash((*seeds, attempt)) % 2**31
            try:
                found = await self.asking.plan(observed, goal, model) or await self._planner.run(
                    plan, wish.task.name, wish.preset, x, goal, model, seed, self._site, tool, wish.method
                )
            except (PlanningError, WorkerError) as error:
                self._announcer.fault("planner", error)
                if attempt + 1 == FAILURES_IN_A_ROW:
                    raise
            else:
                now_s = self._clock.now()
                return self._announcer.say(wish.proposal(found, observed, model, began_s=started_s, now_s=now_s))
        raise AssertionError("the last attempt returns or raises")
