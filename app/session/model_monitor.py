"""The stage that watches whether the model is still right: each push as predicted and as seen, in its own thread."""

import math
from pathlib import Path
from typing import NamedTuple, final

from anyio import to_thread

from app.core.announcer import MessageBus
from app.core.dialogue.model_monitor_messages import Verdict, Watched
from app.core.messages import Model, Proposal, Transition, fresh_id
from app.core.ports import Clock
from app.core.system.channel import Lossless
from app.discovery.monitor.change_detection import FIRST, Watch
from app.discovery.monitor.push_residual import Glance, glance
from app.discovery.monitor.quick_diagnosis import suspect


class ExecutedPush(NamedTuple):
    """A push that was made: the plan, its outcome, and the model in use at its end."""

    proposal: Proposal
    transition: Transition
    model: Model | None


@final
class Watching:
    """Monitor of the model: publishes a `Watched` after every push, and a notice when the model stops being right.

    `processed` of the pushes that were `submitted` have been watched.
    `verdict`: of the discovery that the model in use is from, if it is from one; said at the beginning. `recording`:
    where this session is recorded.
    """

    def __init__(self, announcer: MessageBus, clock: Clock, verdict: Verdict | None, recording: Path | None) -> None:
        self.processed = self.submitted = 0
        self._announcer, self._clock = announcer, clock
        self._verdict, self._recording = verdict, recording
        self._pushes = Lossless[ExecutedPush]("watched pushes", bound=100)
        self._watch = Watch()

    async def put(self, push: ExecutedPush) -> None:
        """Watch this push, soon."""
        self.submitted += 1
        await self._pushes.put(push)

    async def run(self) -> None:
        """Pushes -> messages, for ever. None of it takes more than milliseconds; the loop waits for none of it."""
        if self._verdict is not None:
            self._announcer.say(self._verdict)
        async for push in self._pushes:
            before, (self._watch, watched) = self._watch, await to_thread.run_sync(self._assess_push, push)
            self._announcer.say(watched)
            if self._watch.alarmed and not before.alarmed:
                self._announcer.notice("watch", alarm(watched))
            self.processed += 1

    def _assess_push(self, push: ExecutedPush) -> tuple[Watch, Watched]:
        seen = _glance(push, self._verdict.promised_share if self._verdict else float("nan"))
        watch = self._watch.after(seen)
        return watch, Watched(
            id=fresh_id("watched"),
            cause=(push.transition.id,),
            time_s=self._clock.now(),
            pushes=len(watch.glances),
            state=watch.state,
            since=watch.since,
            evidence=watch.evidence[-1] if watch.evidence else 0.0,
            false_alarm=watch.false_alarm,
            error_m=seen.error_m,
            moved_m=seen.moved_m,
            promised_m=seen.promised_m,
            suspicions=tuple(f"{it.kin}: {it.text}" for it in suspect(watch.pushes_in_doubt)),
            advice=f"dipac discover {self._recording} -o discovery" if self._recording else "",
        )


def alarm(watched: Watched) -> str:
    """Text of the alarm: its begin, its confidence, suspected causes, and what to do."""
    suspected = "; ".join(watched.suspicions) or "nothing stands out"
    to_know = f" To know, end the session and run `{watched.advice}`." if watched.advice else ""
    return (
        f"The model has stopped being right, it seems since motion {watched.since} (false alarms: at most "
        f"{100 * watched.false_alarm:.0f} % of sessions). Suspected: {suspected}.{to_know}"
    )


def _glance(push: ExecutedPush, share: float) -> Glance:
    proposal, transition, model = push
    promised_m = float("nan")
    if model is not None and model.transition_count >= FIRST and math.isfinite(model.loss_m2):
        promised_m = math.sqrt(model.loss_m2 / 2)
    return glance(
        proposal.observed,
        proposal.chosen.predicted,
        transition.before,
        transition.after,
        transition.executed,
        share=share,
        promised_m=promised_m,
    )
