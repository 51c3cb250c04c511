"""Files and folders of other programs, told apart by what they hold, and opened."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from app.core.errors import UsageError
from app.recording.exchange.lerobot.source import DatasetSource, is_dataset
from app.recording.exchange.ros2.bag import is_bag, open_bag
from app.recording.exchange.ros2.source import BagSource
from app.recording.exchange.streams.image_folder import ImageFolder, is_image_folder
from app.recording.exchange.streams.measured_episode import ForeignSource


def is_foreign(path: Path) -> bool:
    """True for what `open_foreign` opens; not for a file of arrays, which needs no mapping."""
    return path.is_dir() or is_bag(path)


@contextmanager
def open_foreign(path: Path) -> Generator[ForeignSource]:
    """The bag or folder at `path`.

    Raises UsageError where it is none of them, PreflightError where the package that reads it is missing, and
    RecordingError where it is damaged.
    """
    if not path.exists():
        raise UsageError.unknown("file", str(path), map(str, sorted(path.parent.glob("*"))))
    if is_bag(path):
        with open_bag(path) as bag:
            yield BagSource(bag)
    elif is_dataset(path):
        yield DatasetSource(path)
    elif is_image_folder(path):
        yield ImageFolder(path)
    else:
        raise _unknown(path)


def _unknown(path: Path) -> UsageError:
    return UsageError(
        f"{path} is no folder that is imported: a bag of ROS 2 has metadata.yaml, a LeRobot dataset meta/info.json, "
        "and images with poses a poses.csv (docs/importing.md)."
    )
