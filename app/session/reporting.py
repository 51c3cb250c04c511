"""The arm's state and the health strip, at a steady pace; and the program's current activity."""

from typing import final

from anyio import to_thread

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.summary import Summary
from app.core.messages import ArmState, Health, fresh_id
from app.core.ports import Clock, Rig
from app.core.system.disk import free_bytes
from app.session.approving import Approving
from app.session.model_updates import Learning
from app.session.perception_stage import Sensing
from app.session.store import SessionStore

_LIVELY = 5
"""States of the arm in a period, while it is moved by hand."""


@final
class Reporting:
    """Says an `ArmState` and a `Health` every period."""

    def __init__(self, site: Site, rig: Rig, summary: Summary, announcer: MessageBus, clock: Clock) -> None:
        self._site, self._rig = site, rig
        self._announcer, self._clock, self._summary = announcer, clock, summary
        self.doing = "starting"
        self._since_s, self._longest_s = clock.now(), 0.0

    def do(self, doing: str) -> None:
        """Set the current activity."""
        self.doing, self._since_s = doing, self._clock.now()

    async def run(self, sensing: Sensing, learning: Learning, approving: Approving, store: SessionStore) -> None:
        """Report for ever."""
        while True:
            disk_free_bytes = await to_thread.run_sync(free_bytes, self._site.recordings, abandon_on_cancel=True)
            arm = await self._state()
            now_s, model = self._clock.now(), store.state.model
            proposal, particles = approving.proposals.value, sensing.particles.value
            self._announcer.say(
                Health(
                    id=fresh_id("health"),
                    time_s=now_s,
                    doing=f"{self.doing} ({now_s - self._since_s:.0f} s)",
                    frame_age_s={name: now_s - c.value.time_s for name, c in sensing.frames.items() if c.value},
                    particles_age_s=now_s - particles.time_s if particles else float("inf"),
                    plan_age_s=now_s - proposal.time_s if proposal else float("inf"),
                    plan_s=proposal.plan_s if proposal else float("nan"),
                    arm_mode=arm.mode,
                    arm_period_s=self._longest_s,
                    model_version=model.version if model else 0,
                    calibrating=learning.busy,
                    calibration_loss_m2=model.loss_m2 if model else float("nan"),
                    drops={channel.name: channel.dropped for channel in (*sensing.frames.values(), sensing.particles)},
                    faults=len(self._summary.faults),
                    disk_free_bytes=disk_free_bytes,
                    cameras={camera.model.name: camera.words for camera in self._rig.cameras if camera.words},
                )
            )
            self._longest_s = 0.0
            await self._until_next(lively=store.state.mode == "teleoperate")

    async def _until_next(self, *, lively: bool) -> None:
        """Wait for the next period; the arm's state is published more often while jogging."""
        pieces = _LIVELY if lively else 1
        for piece in range(pieces):
            await self._clock.sleep(self._site.timing.health_period_s / pieces)
            if piece + 1 < pieces:
                await self._state()

    async def _state(self) -> ArmState:
        """The arm's state now, which has been published; its longest period is kept until it is reported."""
        state = self._announcer.say(await self._rig.arm.state())
        self._longest_s = max(self._longest_s, state.period_s)
        return state
