"""A cell small enough to test the session in: a rig inside this process, a person at the console, a log in memory."""

import dataclasses
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypeVar, final

import anyio
import numpy as np

from app.config import Limits, Site, Timing, Workspace
from app.core.dialogue.approval import Approved
from app.core.dialogue.checklist import ChecklistRequest
from app.core.dialogue.control import ModeName, ModeRequest
from app.core.dialogue.jog import Jog
from app.core.dialogue.requests import Request
from app.core.messages import (
    Decision,
    Executed,
    Goal,
    Health,
    Message,
    Model,
    Notice,
    Proposal,
    ResumeRequest,
    StopRequest,
    fresh_id,
)
from app.core.ports import Studio
from app.core.system.channel import Lossless
from app.session import Parts, Session
from app.tasks.elements.base import EpisodeConfig, Preset
from app.tasks.rope_push import TASK
from tests.session.planner import Habits, planner_here, restored, take_up
from tests.session.rig import Place, SmallRig
from tests.session.virtual import VirtualClock, worker_here

MessageT = TypeVar("MessageT", bound=Message)
A_WHILE = 12
"""Reports of health in which the run would have looked, planned and begun to push, were it allowed to."""
PATIENCE_S = 60.0
"""Longest time [s] that a test waits for anything before it fails; nothing here takes a tenth of it."""


def small_site(folder: Path, **timing: float) -> Site:
    """A site whose waits are all short; `timing` as in `Timing`."""
    soon = {
        "camera_period_s": 0.2,
        "settle_s": 0.05,
        "health_period_s": 0.05,
        "keepalive_s": 0.2,
        "object_unseen_s": 2.0,
    }
    return Site(
        recordings=folder,
        limits=Limits(speed_m_s=0.6, acceleration_m_s2=6.0, stop_deceleration_m_s2=12.0),
        timing=Timing(**(soon | timing)),
    )


def small_wish(*, pushes: int = 1000, automatic: bool = False, staying: bool = False, **more: bool) -> EpisodeConfig:
    """The rope task with 60 particles, and a goal that no stroke will ever reach."""
    preset = Preset(branches=2, depth=1, particle_count=60, gradient_steps=1)
    task = dataclasses.replace(TASK, presets={"small": preset})
    return EpisodeConfig(
        task=task,
        preset="small",
        goal=Goal(id=fresh_id("goal"), time_s=0.0, positions=task.goal(0, preset.particle_count)),
        model=Model(id=fresh_id("model"), time_s=0.0, version=0, task=task.name, parameters=()),
        seed=0,
        pushes=pushes,
        automatic=automatic,
        calibrating=False,
        staying=staying,
        **more,
    )


@final
class Person:
    """The operator: is shown every message, and does what a test says.

    `seen` is all that was shown. `sees` reads on from where it got to the last time, as somebody does who watches.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        self.seen: list[Message] = []
        self._read = 0
        self._stop = stop
        self._shown = anyio.Event()
        self._over = False
        self._error: Exception | None = None
        self._asked = Lossless[Request]("asked", bound=1000)

    def show(self, message: Message) -> None:
        self.seen.append(message)
        self._wake()

    def requests(self) -> AsyncIterator[Request]:
        return aiter(self._asked)

    def all(self, kind: type[MessageT]) -> list[MessageT]:
        """Every message of `kind` so far."""
        return [message for message in self.seen if isinstance(message, kind)]

    def look_away(self) -> None:
        """Skip what was shown so far: read on from now."""
        self._read = len(self.seen)

    async def sees(self, kind: type[MessageT], says: str = "") -> MessageT:
        """The next message of `kind` whose words, if it has any, hold `says`."""
        with anyio.fail_after(PATIENCE_S):
            while True:
                while self._read < len(self.seen):
                    message = self.seen[self._read]
                    self._read += 1
                    if isinstance(message, kind) and says in _words(message):
                        return message
                if self._over:
                    raise AssertionError(f"The run ended before a {kind.__name__} {says!r} was shown.") from self._error
                await self._shown.wait()

    async def decides(
        self, proposal: Proposal, *, approve: bool = True, digest: str | None = None, reason: str = ""
    ) -> Decision:
        """Decide on `proposal`; `digest` is that of the motion the console shows."""
        decision = Decision(
            id=fresh_id("decision"),
            cause=(proposal.id,),
            time_s=anyio.current_time(),
            proposal_id=proposal.id,
            digest=digest or proposal.motion.digest(),
            approve=approve,
            operator="tests",
            reason=reason,
        )
        await self._asked.put(decision)
        return decision

    async def asks(self, request: Request) -> None:
        """Send any other request."""
        await self._asked.put(request)

    async def chooses(self, mode: ModeName, motions: int = 0, *, confirmed: bool = False) -> None:
        """Ask for a mode."""
        await self.asks(
            ModeRequest(
                id=fresh_id("mode"),
                time_s=anyio.current_time(),
                operator="tests",
                mode=mode,
                motions=motions,
                confirmed=confirmed,
            )
        )

    async def confirms(self, *keys: str) -> None:
        """Confirm items of the checklist."""
        for key in keys:
            now_s = anyio.current_time()
            await self.asks(ChecklistRequest(id=fresh_id("checklist"), time_s=now_s, operator="tests", key=key))

    async def presses_stop(self) -> None:
        """Press STOP: the arm is told first, and then the session, as the console does it."""
        self._stop()
        await self._asked.put(StopRequest(id=fresh_id("stop"), time_s=anyio.current_time(), operator="tests"))

    async def presses_resume(self) -> None:
        await self._asked.put(ResumeRequest(id=fresh_id("resume"), time_s=anyio.current_time(), operator="tests"))

    def hears_of_the_end(self, error: Exception | None) -> None:
        """Note that the run has ended, with `error` where it has failed."""
        self._over, self._error = True, error
        self._wake()

    def _wake(self) -> None:
        self._shown.set()
        self._shown = anyio.Event()


def _words(message: Message) -> str:
    """Text of a message: its text, what the program does, its or an arm's mode, an outcome, a reason."""
    return " ".join(str(getattr(message, name, "")) for name in ("where", "text", "doing", "mode", "outcome", "why"))


class Watcher:
    """An operator who asks for nothing and remembers what was said."""

    def __init__(self) -> None:
        self.seen: list[Message] = []

    def show(self, message: Message) -> None:
        self.seen.append(message)

    async def requests(self) -> AsyncIterator[Request]:
        for request in list[Request]():
            yield request

    def notices(self) -> list[str]:
        return [message.text for message in self.seen if isinstance(message, Notice)]


@final
class MemoryLog:
    """A recorder that keeps what it is given."""

    def __init__(self) -> None:
        self.messages: list[Message] = []

    async def write(self, message: Message) -> None:
        self.messages.append(message)


@final
class Run:
    """A session in a small cell, with all that is around it."""

    def __init__(self, config: EpisodeConfig, site: Site, rig: SmallRig, studio: Studio | None = None) -> None:
        self.site, self.rig = site, rig
        self.person, self.log, self.planner = Person(rig.arm.stop), MemoryLog(), planner_here()
        self.session = Session(
            Parts(
                config,
                site=site,
                rig=rig,
                operator=self.person,
                recorder=self.log,
                clock=VirtualClock(),
                planner=self.planner,
                computers=worker_here,
                studio=studio,
            )
        )
        self._error: Exception | None = None
        self._ended = anyio.Event()

    async def go(self) -> None:
        """Run the session to its end, and remember what ended it."""
        try:
            await self.session.run()
        except Exception as error:
            self._error = error
        finally:
            self._ended.set()
            self.person.hears_of_the_end(self._error)

    async def end(self) -> Exception | None:
        """Error that ended the run, None if it ended as it should; waits for the end."""
        with anyio.fail_after(PATIENCE_S):
            await self._ended.wait()
        return self._error

    async def shows_a_plan(self) -> Proposal:
        """The plan that waits for approval now, or the next one that does."""
        self.person.look_away()
        await self.person.sees(Health, "waiting for approval")
        return self.person.all(Proposal)[-1]

    async def plans_with(self, habits: Habits) -> None:
        """Make the planner work with these habits from its next plan on."""
        await self.planner.run(take_up, habits)


@asynccontextmanager
async def running(
    site: Site,
    config: EpisodeConfig,
    *,
    place: Place = "here",
    habits: Habits | None = None,
    rig: SmallRig | None = None,
    studio: Studio | None = None,
) -> AsyncGenerator[Run]:
    """A run that has begun; it ends with the block at the latest. Call `photographs` before, outside of any loop."""
    run = Run(config, site, rig or SmallRig(site), studio)
    run.rig.table.place = place
    with restored():
        await run.plans_with(habits or Habits())
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(run.go)
            yield run
            tasks.cancel_scope.cancel()


def withdrawn(notice: Notice, proposal: Proposal) -> bool:
    """True if `notice` takes `proposal` away from the operator."""
    return proposal.id in notice.cause


async def fresh_plan(run: Run) -> Proposal:
    """A plan made for the table as it is now, waiting for approval."""
    old = await run.shows_a_plan()
    return await another_plan(run, instead_of=old)


async def another_plan(run: Run, *, instead_of: Proposal) -> Proposal:
    """The plan that comes when one is rejected."""
    await run.person.decides(instead_of, approve=False)
    return await run.person.sees(Proposal)


async def pushes(run: Run, proposal: Proposal) -> Executed:
    """Approve `proposal`, and see that exactly its motion is approved and made."""
    decision = await run.person.decides(proposal)
    approved = await run.person.sees(Approved)
    executed = await run.person.sees(Executed)
    assert approved.cause == (proposal.id, decision.id)
    assert approved.digest == proposal.motion.digest()
    assert executed.cause == (approved.id,) == (run.rig.arm.begun[-1],)
    return executed


async def for_a_while(run: Run) -> list[Message]:
    """Messages shown while the run goes on for a while."""
    before = len(run.person.seen)
    for _ in range(A_WHILE):
        await run.person.sees(Health)
    return run.person.seen[before:]


async def jogs(run: Run, linear: tuple[float, float, float], samples: int = 12) -> int:
    """Jog with this velocity for a little; number of samples that the arm heeded."""
    heeded = 0
    for _ in range(samples):
        heeded += run.rig.arm.jog(Jog(linear=np.array(linear)))
        await anyio.sleep(0.03)
    return heeded


def some(kind: type[Message], messages: list[Message]) -> bool:
    return any(isinstance(message, kind) for message in messages)


def narrower(site: Site) -> Site:
    """A site whose arm reaches none of the planner's strokes."""
    box = Workspace(high=(0.31, *site.limits.workspace.high[1:]))
    return dataclasses.replace(site, limits=dataclasses.replace(site.limits, workspace=box))
