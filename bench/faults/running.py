"""The application with its real rig, recorder, workers and session, and what can be done wrong in it by order."""

import json
import os
import sys
import threading
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import replace
from functools import partial
from multiprocessing import active_children
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, final

import anyio
import numpy as np
from anyio import to_thread
from anyio.from_thread import BlockingPortal

from app.core.dialogue.control import EndRequest, Lease, ModeName, ModeRequest
from app.core.dialogue.requests import Request
from app.core.errors import DipacError
from app.core.messages import (
    ArmState,
    Decision,
    Episode,
    Goal,
    Message,
    Model,
    Proposal,
    ResumeRequest,
    StopRequest,
    fresh_id,
)
from app.core.system.channel import ChannelFull, Lossless
from app.core.system.processes import process
from app.core.system.worker import Worker
from app.recording.library.session_recorder import open_studio
from app.recording.write.preflight import Room
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.session import Parts, Session
from app.tasks.elements.base import EpisodeConfig, Preset
from app.tasks.rope_push import TASK
from app.teleop import Pilot
from bench.faults.broken import FaultyClock, FaultyRig, Shows
from bench.faults.hand import Hand
from bench.faults.place import site
from bench.faults.standin import Finds, Plans, spoil_particles, stand_in
from bench.faults.witness import witness

_PRESET = "small"
_OPERATOR = "bench"
_POLL_S = 0.05
_ASKED = 1000
"""Requests that wait, as many as a console keeps."""


def config(*, calibrating: bool) -> EpisodeConfig:
    """The rope with 60 particles, and a goal that no stroke will ever reach."""
    task = replace(TASK, presets={_PRESET: Preset(branches=2, depth=1, particle_count=60, gradient_steps=1)})
    return EpisodeConfig(
        task=task,
        preset=_PRESET,
        goal=Goal(id=fresh_id("goal"), time_s=time.monotonic(), positions=task.goal(0, 60)),
        model=Model(id=fresh_id("model"), time_s=0.0, version=0, task=task.name, parameters=()),
        seed=0,
        pushes=1000,
        automatic=False,
        calibrating=calibrating,
        staying=True,
    )


def said(event: str, **told: object) -> None:
    """Print a line for the bench's driver."""
    sys.stdout.write(json.dumps({"event": event, "now_s": time.monotonic(), **told}) + "\n")
    sys.stdout.flush()


@final
class Attendant:
    """The operator: reports shown messages, approves if told to, and sends requests."""

    def __init__(self) -> None:
        self.approves, self.names = True, ""
        self._asked = Lossless[Request]("operator requests", bound=_ASKED)

    def show(self, message: Message) -> None:
        """Put a message before the operator."""
        kind = type(message).__name__
        words = " ".join(str(getattr(message, name, "")) for name in ("where", "text", "doing", "mode", "outcome"))
        if not isinstance(message, ArmState):
            said("shown", kind=kind, time_s=message.time_s, words=words, fatal=getattr(message, "fatal", False))
        if isinstance(message, Proposal) and self.approves:
            self.decide(message.id, self.names or message.motion.digest())

    def requests(self) -> AsyncIterator[Request]:
        """Requests in order."""
        return aiter(self._asked)

    def decide(self, proposal_id: Any, digest: str) -> None:
        """Approve what has this name and these numbers."""
        self.ask(
            Decision(
                id=fresh_id("decision"),
                cause=(proposal_id,),
                time_s=time.monotonic(),
                proposal_id=proposal_id,
                digest=digest,
                approve=True,
                operator=_OPERATOR,
            )
        )

    def ask(self, request: Request) -> None:
        """Send a request as the console does: if the queue is full it is lost."""
        try:
            self._asked.put_nowait(request)
        except ChannelFull as error:
            said("lost", words=str(error))


@final
class Orders:
    """Remote commands, by the names of the methods; each is called by the event loop."""

    def __init__(
        self, session: Session, rig: SimulatedRig, faulty: FaultyRig, attendant: Attendant, hand: Hand
    ) -> None:
        self._session, self._rig, self._cameras = session, rig, faulty.cameras
        self._attendant, self._hand = attendant, hand
        self._clock = session.parts.clock

    def mode(self, mode: ModeName) -> None:
        """Change the mode."""
        self._attendant.ask(Lease(**_named("lease"), holder=_OPERATOR, why="bench"))
        motions = 1000 if mode == "automatic" else 0
        self._attendant.ask(ModeRequest(**_named("mode"), operator=_OPERATOR, mode=mode, motions=motions))

    def resume(self) -> None:
        """Lift a stop."""
        self._attendant.ask(ResumeRequest(**_named("resume"), operator=_OPERATOR))

    def stop(self) -> None:
        """Press STOP: the arm hears of it first."""
        self._rig.arm.stop()
        self._attendant.ask(StopRequest(**_named("stop"), operator=_OPERATOR))

    def end(self) -> None:
        """End the session."""
        self._attendant.ask(EndRequest(**_named("end"), operator=_OPERATOR))

    def hold(self) -> None:
        """Press a key, and keep it."""
        self._hand.hold()

    def release(self) -> None:
        """Release the key."""
        self._hand.release()

    def vanish(self) -> None:
        """Drop the page without closing its connection."""
        self._hand.vanish()

    def cut(self) -> None:
        """Close the connection, upon which the console gives control back."""
        self._hand.vanish()
        self._hand.pilot.let_go(_OPERATOR)
        self._attendant.ask(Lease(**_named("lease"), holder="", why="its page is gone"))

    def babble(self) -> None:
        """Send malformed messages from the page."""
        self._hand.babble()

    def block(self, duration_s: float) -> None:
        """Block the event loop."""
        time.sleep(duration_s)

    def freeze(self, duration_s: float) -> None:
        """Stop the clock."""
        assert isinstance(self._clock, FaultyClock), "the bench brings its own"
        self._clock.freeze(duration_s)

    def cameras(self, shows: Shows) -> None:
        """Set the content of all cameras' images."""
        for camera in self._cameras:
            camera.shows = shows

    def flood(self, count: int, what: str) -> None:
        """Send so many requests at once, as from broken pages."""
        for number in range(count):
            match what:
                case "modes":
                    self.mode(("idle", "plan only", "approve each", "automatic")[number % 4])
                case "decisions":
                    self._attendant.decide(fresh_id("proposal"), "0" * 64)
                case _:
                    self.stop()

    def misname(self, digest: str) -> None:
        """Approve plans by this digest from now on, by their own where it is empty."""
        self._attendant.names = digest

    def approves(self, yes: bool) -> None:
        """Set whether plans are approved."""
        self._attendant.approves = yes

    def processes(self) -> None:
        """Report the process ids."""
        said("processes", pids={each.name.removeprefix("dipac "): each.pid for each in active_children()})

    async def plans(self, plans: Plans) -> None:
        """Select the planner's motions from now on."""
        await self._session.parts.planner.run(stand_in, plans)

    async def finds(self, finds: Finds) -> None:
        """Select perception's results from now on."""
        await self._session.parts.sensing.perceiver.run(spoil_particles, finds)


def _named(kind: str) -> dict[str, Any]:
    return {"id": fresh_id(kind), "time_s": time.monotonic()}


async def application(folder: Path, *, calibrating: bool, budget_bytes: int | None) -> None:
    """Run until the end is ordered. Raises the DipacError that ends it before."""
    where, clock, attendant = site(folder), FaultyClock(), Attendant()
    start = Episode(
        id=fresh_id("episode"),
        time_s=time.monotonic(),
        task=TASK.name,
        rig="simulated",
        seed=0,
        simulated=True,
        code_version="",
        config="{}",
    )
    small = tuple(
        replace(camera, width=320, height=240, K=np.diag([0.5, 0.5, 1.0]) @ camera.K) for camera in table_cameras()
    )
    cell = simulated_rig(stage=TASK.stage, start=_straight(), site=where, seed=0, cameras=small)
    async with (
        Worker("planner") as planner,
        open_studio(folder, start, Room(budget_bytes=budget_bytes)) as recorder,
        cell as rig,
    ):
        await _witnessed(rig, folder)
        faulty = FaultyRig(rig)
        hand = Hand(Pilot(jog=rig.arm.jog, tool=rig.arm.tool, limits=where.limits), _OPERATOR)
        session = Session(
            Parts(
                config(calibrating=calibrating),
                site=where,
                rig=faulty,
                operator=attendant,
                recorder=recorder,
                clock=clock,
                planner=planner,
                recording=recorder.path,
                studio=recorder,
            )
        )
        orders = Orders(session, rig, faulty, attendant, hand)
        failure = await _obeying(session, orders, recorder.path)
    if failure is not None:
        raise failure


async def _obeying(session: Session, orders: Orders, recording: Path) -> DipacError | None:
    """Run the session, and execute orders; returns the error that ended it, if any."""
    async with BlockingPortal() as portal:
        threading.Thread(target=_obey, args=(portal, orders), daemon=True).start()
        said("begun", recording=str(recording))
        try:
            await session.run()
        except DipacError as error:
            return error
        finally:
            await portal.stop(cancel_remaining=True)
    return None


def _straight() -> np.ndarray:
    """A rope along y, 10 cm beyond the strokes (K, 3) [m]."""
    nodes = TASK.start(0)
    y = np.linspace(-0.2, 0.2, len(nodes))
    return np.stack([np.full_like(y, 0.54), y, np.full_like(y, 0.008)], axis=1)


async def _witnessed(rig: SimulatedRig, folder: Path) -> None:
    """Record the arm's states, from before its first motion."""
    states = folder / "states"
    watcher = process("witness", witness, rig.memory, states, os.getpid())
    watcher.daemon = False  # It outlives the application.
    await to_thread.run_sync(_started, watcher, states)


def _started(watcher: BaseProcess, states: Path) -> None:
    watcher.start()
    while watcher.is_alive() and not (states.exists() and states.stat().st_size):
        time.sleep(_POLL_S)


def _obey(portal: BlockingPortal, orders: Orders) -> None:
    """Orders, for as long as there is a loop to obey them."""
    for line in sys.stdin:
        order = json.loads(line)
        name = order.pop("order")
        try:
            portal.start_task_soon(partial(getattr(orders, name), **order))
        except RuntimeError:
            return


def main(arguments: Sequence[str]) -> int:
    """Run it, and say what ended it."""
    folder, *options = arguments
    budget = next((int(each.partition("=")[2]) for each in options if each.startswith("--budget=")), None)
    run = partial(application, Path(folder), calibrating="--calibrating" in options, budget_bytes=budget)
    try:
        anyio.run(run)
    except DipacError as error:
        said("ended", error=str(error), kind=type(error).__name__)
        return error.exit_code
    said("ended", error="", kind="")
    return 0
