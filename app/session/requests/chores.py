"""Requests of an operator that take a while, done beside the loop, one after the other."""

from typing import final

from app.core.dialogue.requests import (
    CalibrationRequest,
    Chore,
    ClipRequest,
    ColourRequest,
    DemonstrationRequest,
    EditRequest,
    GoalRequest,
    MeasureRequest,
    ModelRequest,
    PictureGoalRequest,
    ProbeRequest,
    StartPoseRequest,
    TakeRequest,
)
from app.core.messages import Message
from app.core.system.channel import ChannelFull, Lossless
from app.session.parts import Parts
from app.session.requests.wait_until_still import until_at_rest
from app.session.stages import SessionStages
from app.session.state import Interruption, Reconfiguration

_CHORES = 8
"""Bound of waiting requests; some hold pictures, and take seconds each."""


@final
class Chores:
    """Queue of these requests."""

    def __init__(self, parts: Parts, stages: SessionStages) -> None:
        self._parts, self._stages, self._store = parts, stages, parts.store
        self._queue = Lossless[Chore]("chores", bound=_CHORES)

    def put(self, chore: Chore) -> None:
        """Queue a request; other requests never wait for it."""
        try:
            self._queue.put_nowait(chore)
        except ChannelFull:
            text = "Too much was asked for at once; wait for what is being done."
            self._parts.announcer.notice("console", text, chore.id)

    async def run(self) -> None:
        """Fulfil requests, for ever."""
        async for chore in self._queue:
            match chore:
                case GoalRequest() | PictureGoalRequest():
                    await self._aim(chore)
                case TakeRequest():
                    await self._demonstrate(chore)
                case ClipRequest():
                    await self._parts.demonstrating.clip(chore)
                case EditRequest():
                    await self._edit(chore)
                case ModelRequest():
                    await self._use(chore)
                case ProbeRequest():
                    self._parts.probing.handle(chore, lambda why: self._store.dispatch(Interruption(why)))
                case StartPoseRequest() | DemonstrationRequest():
                    await self._request_motions(chore)
                case MeasureRequest():
                    await self._parts.measuring.handle(chore, self._store.state.config.task)
                case ColourRequest():
                    self._parts.sensing.recolour(chore)
                case CalibrationRequest():
                    await self._parts.calibrating.handle(chore, self._store.state.mode)

    async def _aim(self, request: GoalRequest | PictureGoalRequest) -> None:
        how, state = self._parts.sensing.seeing.how, self._store.state
        if config := await self._parts.aiming.choose_goal(state.config, request, how, state.model):
            self._parts.planning.forget()
            self._store.dispatch(Reconfiguration(config, "is for another goal"))

    async def _edit(self, request: EditRequest) -> None:
        """Simulate a change of the plan that is shown, which stays up until then, and propose it instead."""
        parts, state = self._parts, self._store.dispatch(request)
        seen, shown = parts.sensing.particles.value, state.shown_plan(request.proposal_id)
        if seen is None or shown is None or state.requested is not None:
            return
        changed = await parts.planning.edit(state.config, request, shown, seen, state.model_in_use)
        if changed is not None and self._store.state.shown_plan(shown.id):
            state = self._store.dispatch(Interruption("is offered as you changed it"))
            parts.planning.offer_next(changed, state.interruptions)

    async def _request_motions(self, request: StartPoseRequest | DemonstrationRequest) -> None:
        """Offer what was asked for, if it can be made from here, instead of the plan that is shown."""
        parts, config = self._parts, self._store.state.config
        event = await parts.requested_motions.on_request(request, config, parts.sensing.particles.value)
        if event is not None:
            self._store.dispatch(event)

    async def _use(self, request: ModelRequest) -> None:
        """Plan with another model, and with the goal as its cameras observe it."""
        state = self._store.state
        if chosen := await self._parts.modelling.chosen_model(request, state.model_in_use, state.config.goal.positions):
            self._parts.planning.forget()
            self._store.dispatch(chosen)

    async def _demonstrate(self, request: TakeRequest) -> None:
        """Begin or end a demonstration; a motion that is being made belongs to what there is, once it was seen."""
        parts = self._parts
        if request.act != "discard":
            await until_at_rest(parts.rig.arm, parts.site.timing, parts.clock, acts=lambda: self._stages.acts)
        await parts.demonstrating.handle(request, self._opening_messages)

    def _opening_messages(self) -> list[Message]:
        """Messages at the beginning of a recording that make it complete by itself."""
        parts, goal = self._parts, self._store.state.config.goal
        frames = [channel.value for channel in parts.sensing.frames.values()]
        known = (goal, self._store.mode, self._store.state.model, *frames, parts.sensing.particles.value)
        return [message for message in known if message is not None]
