"""What somebody said of a whole episode: whether it succeeded, and why. The last word counts; earlier ones are kept."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal, Self, TypeAlias, final, get_args

from mcap.reader import make_reader

from app.core.errors import RecordingError
from app.recording.append import append_metadata
from app.recording.integrity import DAMAGE, damaged, inspect, reading

LABEL: Final = "dipac.label"
"""The name of the metadata records that hold labels, in the order in which they were given."""

Verdict: TypeAlias = Literal["success", "failure", "unlabelled"]
VERDICTS: Final[tuple[Verdict, ...]] = get_args(Verdict)


@final
@dataclass(frozen=True, kw_only=True)
class Label:
    """`said` by `operator`, with a `note` in words; "unlabelled" takes back what was said before. `at`: ISO 8601."""

    said: Verdict
    note: str = ""
    operator: str = ""
    at: str = ""

    @classmethod
    def now(cls, said: Verdict, *, note: str, operator: str) -> Self:
        """One of this moment."""
        return cls(said=said, note=note, operator=operator, at=datetime.now(UTC).isoformat(timespec="seconds"))

    @classmethod
    def read(cls, metadata: Mapping[str, str]) -> Self:
        """From a metadata record. Raises RecordingError where it says something unknown."""
        said = metadata.get("said", "")
        if said not in VERDICTS:
            raise RecordingError(f"A label says {said!r}; known are {', '.join(VERDICTS)}.")
        rest = {name: metadata.get(name, "") for name in ("note", "operator", "at")}
        return cls(said=said, **rest)

    def written(self) -> dict[str, str]:
        """As the metadata of a record."""
        return asdict(self)


def labels(path: Path) -> Sequence[Label]:
    """Every label that the whole recording at `path` has had, oldest first. Raises as `integrity.inspect`."""
    inspect(path)
    with reading(path), path.open("rb") as stream:
        try:
            records = [record for record in make_reader(stream).iter_metadata() if record.name == LABEL]
        except DAMAGE as error:
            raise damaged(path, error) from error
    return [Label.read(record.metadata) for record in records]


def relabel(path: Path, label: Label) -> None:
    """Say something else of the whole recording at `path`. Raises as `integrity.inspect`, and where it cannot write."""
    inspect(path)
    append_metadata(path, LABEL, label.written())
