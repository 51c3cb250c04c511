"""Labels of whole episodes: success or failure, and a reason. The last one counts; earlier ones are kept."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal, Self, TypeAlias, final, get_args

from mcap.reader import make_reader

from app.core.errors import RecordingError
from app.recording.format.integrity import DAMAGE, damage_error, inspect, reading
from app.recording.write.append import append_metadata

LABEL: Final = "dipac.label"
"""Name of the metadata records that hold labels, in the order in which they were given."""

SuccessLabel: TypeAlias = Literal["success", "failure", "unlabelled"]
SUCCESS_LABELS: Final[tuple[SuccessLabel, ...]] = get_args(SuccessLabel)


@final
@dataclass(frozen=True, kw_only=True)
class Label:
    """Label `said` by `operator`, with a `note` in words; "unlabelled" revokes an earlier one. `at`: ISO 8601."""

    said: SuccessLabel
    note: str = ""
    operator: str = ""
    at: str = ""

    @classmethod
    def now(cls, said: SuccessLabel, *, note: str, operator: str) -> Self:
        """A label dated now."""
        return cls(said=said, note=note, operator=operator, at=datetime.now(UTC).isoformat(timespec="seconds"))

    @classmethod
    def read(cls, metadata: Mapping[str, str]) -> Self:
        """A label from a metadata record. Raises RecordingError where its verdict is unknown."""
        said = metadata.get("said", "")
        if said not in SUCCESS_LABELS:
            raise RecordingError(f"A label says {said!r}; known are {', '.join(SUCCESS_LABELS)}.")
        rest = {name: metadata.get(name, "") for name in ("note", "operator", "at")}
        return cls(said=said, **rest)

    def written(self) -> dict[str, str]:
        """The label as metadata of a record."""
        return asdict(self)


def labels(path: Path) -> Sequence[Label]:
    """Every label that the whole recording at `path` has had, oldest first. Raises as `integrity.inspect`."""
    inspect(path)
    with reading(path), path.open("rb") as stream:
        try:
            records = [record for record in make_reader(stream).iter_metadata() if record.name == LABEL]
        except DAMAGE as error:
            raise damage_error(path, error) from error
    return [Label.read(record.metadata) for record in records]


def relabel(path: Path, label: Label) -> None:
    """Add a new label to the complete recording at `path`. Raises as `integrity.inspect`, and where it cannot write."""
    inspect(path)
    append_metadata(path, LABEL, label.written())
