"""A recording of three motions, half a second a message, as a session leaves it."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from app.core.dialogue.approval import ApprovalGate
from app.core.messages import Decision, Message, Transition, fresh_id
from app.recording.write.file import EpisodeFile
from tests.ui import synthetic

PERIOD_S = 0.5
DISTANCES_MM = ("22.4", "31.6", "38.7")
"""Distances [mm] of the motions' plans, as the card shows them."""
_CHAMFER_M2 = (1e-3, 2e-3, 3e-3)


def film(folder: Path) -> Path:
    """The recording, in `folder`."""
    told = list(session())
    path, began_s = folder / "session.mcap", time.monotonic()
    episode = replace(synthetic.episode(), time_s=began_s)
    file = EpisodeFile(path, episode)
    file.write(episode, now_s=began_s)
    for number, message in enumerate(told, start=1):
        now_s = began_s + PERIOD_S * number
        file.write(replace(message, time_s=now_s), now_s=now_s)
    file.close()
    return path


def session() -> Iterator[Message]:
    """Messages of the session apart from the episode, in order."""
    yield synthetic.goal()
    yield synthetic.model(1, 6e-5)
    for index, chamfer_m2 in enumerate(_CHAMFER_M2):
        observed = synthetic.rope(0.5 - 0.1 * index)
        seen = synthetic.particles(observed)
        yield synthetic.frame(synthetic.camera("left", -1.0), observed)
        yield seen
        yield synthetic.arm()
        plan = replace(synthetic.proposal(observed, seed=index, branches=4), chamfer_m2=chamfer_m2)
        yield plan
        yield synthetic.health("waiting for approval (1 s)")
        decision = Decision(
            id=fresh_id("decision"),
            time_s=plan.time_s,
            proposal_id=plan.id,
            digest=plan.motion.digest(),
            approve=True,
            operator="client 0",
        )
        yield decision
        gate = ApprovalGate(max_age_s=1e9, max_unseen_s=1e9, max_drift_m=1e9)
        gate.show(plan)
        yield gate.approve(decision, latest=seen, now_s=plan.time_s)
        made = replace(synthetic.executed(plan.motion.positions), cause=(plan.id,))
        yield made
        after = synthetic.particles(synthetic.rope(0.4 - 0.1 * index))
        yield after
        yield Transition.between(seen, made, after)
        yield synthetic.outcome(index + 1)
        yield synthetic.notice("plan", f"That was motion {index + 1}.")
