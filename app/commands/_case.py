"""Results of `dipac discover`, read from their folder for the console: verdict, model, and suggested motion."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from app.config import Site
from app.core.dialogue.model_monitor_messages import Blamed, Verdict
from app.core.errors import RecordingError, UsageError
from app.core.messages import fresh_id
from app.core.motion import Motion

if TYPE_CHECKING:
    from app.report.schema import CauseEntry, HeldoutEntry, NextPushEntry

VERDICT, MODEL = "verdict.json", "model.toml"
_UNKNOWN = float("nan")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class DiscoveryResults:
    """Results of a discovery. `asked`: the suggested next motion of the tool."""

    verdict: Verdict
    asked: tuple[Motion, ...]


def read_case(folder: Path, task: str, site: Site, time_s: float, own_model: bool) -> DiscoveryResults:
    """The verdict in `folder`, as a message of now; to be run in a process that may load the simulator.

    `own_model`: whether the model in use is the one beside it, which the verdict says the errors of.

    Raises UsageError where there is no verdict or it is about another task, RecordingError where it is none.
    """
    import msgspec

    from app.report.schema import VerdictFile

    path = folder / VERDICT
    try:
        file = msgspec.json.decode(path.read_bytes(), type=VerdictFile)
    except OSError as error:
        raise UsageError(
            f"Cannot read {path}: {error.strerror}; give --case the folder that `dipac discover ... -o DIR` wrote."
        ) from None
    except msgspec.DecodeError as error:
        raise RecordingError(f"{path} is not a verdict of this version: {error}; run `dipac discover` again.") from None
    if file.amount.task != task:
        raise UsageError(f"{path} is about task {file.amount.task!r}, not {task!r}; name that task.")
    verdict = Verdict(
        id=fresh_id("verdict"),
        time_s=time_s,
        source=str(path),
        kind=file.verdict,
        sentences=file.sentences,
        causes=tuple(map(_blamed_cause, file.causes)),
        ranking=tuple(sorted(map(_blamed_cause, file.ranking), key=lambda it: -it.probability)),
        next_push=file.next_push.text if file.next_push else "",
        promised_share=_heldout_error_share(file.heldout) if own_model else _UNKNOWN,
    )
    return DiscoveryResults(verdict=verdict, asked=_push_motions(file.next_push, task, site) if file.next_push else ())


def _blamed_cause(cause: "CauseEntry") -> Blamed:
    from app.report.drawing.words import measurement, title

    size, low, high = (_UNKNOWN if it is None else it for it in (cause.size, cause.low, cause.high))
    return Blamed(
        effect=cause.effect,
        title=title(cause.effect),
        family=cause.family,
        size=measurement(size, low, high, cause.unit),
        probability=0.0 if cause.probability is None else cause.probability,
    )


def _heldout_error_share(heldout: "HeldoutEntry") -> float:
    """The model's error on episodes left out, as a share of the object's motion; NaN if unknown."""
    if not heldout.extended or not heldout.still:
        return _UNKNOWN
    return heldout.extended / heldout.still


def _push_motions(push: "NextPushEntry", task: str, site: Site) -> tuple[Motion, ...]:
    """The suggested motion of the tool, as one that the arm can make."""
    import numpy as np

    from app.core.geometry.track import Track
    from app.jobs.suggestions.plan import motion_of
    from app.tasks import load

    track = Track(times_s=np.array(push.track.times_s, float), poses=np.array(push.track.poses, float))
    return (motion_of(track, load(task).actions, site),)
