"""Parts of a session, each with one task, and how they are put together."""

from pathlib import Path
from typing import final

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.summary import Summary
from app.core.errors import MotionRefused
from app.core.ports import CameraShelf, Clock, Computer, Computers, Operator, Recorder, Rig, Studio
from app.core.rejection_codes import Refusal
from app.core.system.worker import Worker
from app.session.approving import Approving
from app.session.gates import Preflight, StopLatch, confirmable
from app.session.model_monitor import Watching
from app.session.model_updates import Learning, Modelling
from app.session.perception_stage import Sensing
from app.session.planning import Planning
from app.session.reporting import Reporting
from app.session.requests.calibrating import Calibrating
from app.session.requests.demonstrating import Demonstrating
from app.session.requests.goals import Aiming
from app.session.requests.measuring import Measuring
from app.session.requests.requested_motions import RequestedMotionProposals
from app.session.state import SessionState
from app.session.store import SessionStore
from app.session.suggested_motions import Probing
from app.tasks.elements.base import EpisodeConfig


@final
class Parts:
    """All parts of a session. `store` holds its state, by which they wait for each other.

    `planner`, and what `computers` makes: the places of heavy work. `recording`: where the session is recorded;
    `studio`, `shelf`: for demonstrations, calibrations.

    Raises MotionRefused where an episode is automatic and something real can move.
    """

    def __init__(
        self,
        config: EpisodeConfig,
        *,
        site: Site,
        rig: Rig,
        operator: Operator,
        recorder: Recorder,
        clock: Clock,
        planner: Computer,
        computers: Computers = Worker,
        recording: Path | None = None,
        studio: Studio | None = None,
        shelf: CameraShelf | None = None,
    ) -> None:
        if config.automatic and not rig.simulated:
            raise MotionRefused(Refusal.NOT_SIMULATED, "Automatic: on a simulated rig alone; use `dipac console`.")
        self.site, self.rig, self.operator, self.clock, self.planner = site, rig, operator, clock, planner
        self.summary = Summary()
        self.announcer = MessageBus(operator=operator, recorder=recorder, clock=clock, summary=self.summary)
        how, by = config.task.reconstruction(config.preset), (self.announcer, clock)
        self.store = SessionStore(_initial(config, site, rig, now_s=clock.now()), *by)
        self.latch = StopLatch(rig.arm, self.store, *by)
        self.sensing = Sensing(rig, how, self.summary, *by, computers)
        self.learning = Learning(config, site, self.store, self.announcer, computers)
        self.modelling = Modelling(config.task.name, planner, *by)
        self.probing = Probing(config, planner, site, self.sensing, *by)
        self.planning = Planning(config, planner, site, self.probing, *by)
        self.preflight = Preflight(rig, site, self.sensing, self.store, clock)
        self.approving = Approving(site, self.sensing, self.store, *by)
        self.watching = Watching(*by, config.verdict, recording)
        self.reporting = Reporting(site, rig, self.summary, *by)
        self.aiming = Aiming({each.model.name: each.model for each in rig.cameras}, self.sensing.perceiver, site, *by)
        self.demonstrating = Demonstrating(studio, *by)
        self.measuring = Measuring(self.sensing, *by, computers)
        self.requested_motions = RequestedMotionProposals(site, rig.arm, planner, studio, *by)
        self.calibrating = Calibrating(rig, self.sensing.frames, shelf, site, *by, computers)


def _initial(config: EpisodeConfig, site: Site, rig: Rig, *, now_s: float) -> SessionState:
    """State at the begin of a session; without a checklist, motion is permitted at once."""
    unchecked = rig.simulated and not config.checklist
    return SessionState(
        config=config,
        automatic="freely" if rig.simulated else "confirmed" if config.allow_automatic else "never",
        mode="automatic" if config.automatic else "approve each",
        motions=config.pushes,
        resumed_s=now_s,
        confirmable=confirmable(site.limits),
        passed=unchecked,
        by_hand=unchecked,
    )
