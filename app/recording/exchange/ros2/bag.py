"""A bag of ROS 2 as topics and messages, by the package `rosbags`; its errors name what mends the file."""

import struct
import warnings
from collections.abc import Collection, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, Final, NamedTuple, Self, final

from zstandard import ZstdDecompressor, ZstdError

from app.core.errors import PreflightError, RecordingError, UsageError

NS: Final = 1_000_000_000
SUFFIXES: Final = (".mcap", ".db3")
METADATA: Final = "metadata.yaml"
_CUT: Final = ("magic", "truncated", "footer", "malformed", "not a database", "disk image", "empty", "missing tables")
_NEWEST_NS: Final = 2**63 - 1
_MOST_BYTES: Final = 256 << 20
"""Largest message: no image or cloud of a cell is as large."""
_ZSTD: Final = b"\x28\xb5\x2f\xfd"
"""First bytes of a frame of Zstandard (RFC 8878, 3.1.1)."""


@final
@dataclass(frozen=True, kw_only=True)
class BagTopic:
    """A topic of a bag: its type, and the number of its messages."""

    name: str
    kind: str
    count: int


class MessageStamp(NamedTuple):
    """Times of a message [ns]: received, and in its header (None where it has none), with the header's frame."""

    topic: str
    received_ns: int
    stamped_ns: int | None
    frame: str


@final
class Bag:
    """An opened bag; messages of types that ROS itself brings are decoded.

    `topics`: by name; the type is empty where a topic has several. `start_ns`: time of the first message [ns];
    `duration_s`: from there to the last.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rosbag2, stores = _load()
        self._types = stores.get_typestore(stores.Stores.LATEST)
        self._reader: Any = None
        self.topics: Mapping[str, BagTopic] = {}
        self.start_ns, self.duration_s = 0, 0.0

    def __enter__(self) -> Self:
        with self._explain_errors(), ExitStack() as stack:
            self._reader = self._rosbag2.Reader(_storage(self.path))
            self._reader.open()
            stack.callback(self._reader.close)
            self.topics = {
                name: BagTopic(name=name, kind=_whole_type(info.msgtype or ""), count=int(info.msgcount))
                for name, info in self._reader.topics.items()
            }
            self.start_ns = int(self._reader.start_time)
            self.duration_s = max(int(self._reader.duration) - 1, 0) / NS
            stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.close()

    def stamps(self, topics: Collection[str]) -> Iterator[MessageStamp]:
        """Times of the messages of topics with a header, which are not decoded."""
        for connection, received_ns, data in self._raw(topics, None, None):
            stamped, frame = _header(data[:_HEADER_BYTES])
            yield MessageStamp(connection.topic, received_ns, stamped, frame)

    def messages(
        self, topics: Collection[str], first_ns: int | None = None, last_ns: int | None = None
    ) -> Iterator[tuple[str, int, Any]]:
        """BagTopic, time of receipt [ns] and message, for those received from `first_ns` to `last_ns`."""
        for connection, received_ns, data in self._raw(topics, first_ns, last_ns):
            yield connection.topic, received_ns, self._decode(connection, data)

    def first(self, topic: str) -> Any | None:
        """The first message of a topic; None where it has none."""
        with self._explain_errors():
            return next((message for _, _, message in self.messages([topic])), None)

    def _raw(
        self, topics: Collection[str], first_ns: int | None, last_ns: int | None
    ) -> Generator[tuple[Any, int, bytes]]:
        connections = [it for it in self._reader.connections if it.topic in topics]
        if not connections:
            return
        stop = None if last_ns is None else min(last_ns + 1, _NEWEST_NS)
        messages = self._reader.messages(connections=connections, start=first_ns, stop=stop)
        while True:
            with self._explain_errors():
                found = next(messages, None)
            if found is None:
                return
            connection, received_ns, data = found
            yield connection, received_ns, self._unpack(connection, bytes(data))

    def _unpack(self, connection: Any, data: bytes) -> bytes:
        """The message, decompressed: bags say in their metadata that each message is, and a file alone says nothing."""
        if not data.startswith(_ZSTD):
            return data
        try:
            with ZstdDecompressor().stream_reader(data) as stream:
                found = stream.read(_MOST_BYTES + 1)
        except ZstdError as error:
            raise self._decoding_error(connection, str(error)) from None
        if len(found) > _MOST_BYTES:
            raise self._decoding_error(connection, "it is larger than 256 MB")
        return found

    def _decode(self, connection: Any, data: bytes) -> Any:
        try:
            return self._types.deserialize_cdr(data, _whole_type(connection.msgtype))
        except Exception as error:  # The bytes are untrusted, and the decoder raises any error.
            raise self._decoding_error(connection, str(error) or type(error).__name__) from None

    def _decoding_error(self, connection: Any, why: str) -> RecordingError:
        return RecordingError(
            f"{self.path}: a message of {connection.topic} is no {connection.msgtype} in CDR ({why}); leave it out of "
            "the file of --topics, or record it anew."
        )

    @contextmanager
    def _explain_errors(self) -> Generator[None]:
        """Turns what the reader raises into an error that names the next step."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                yield
        except RecordingError:
            raise
        except Exception as error:  # The file is untrusted, and its readers raise any error.
            raise RecordingError(_explanation(self.path, error)) from None


_HEADER_BYTES: Final = 512


def _whole_type(name: str) -> str:
    """The name of a type with its kind, which some writers leave out: `std_msgs/msg/String` for `std_msgs/String`."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name


def _header(data: bytes) -> tuple[int | None, str]:
    """Stamp [ns] and frame in the first bytes of a message that begins with a header (std_msgs/Header in CDR)."""
    if len(data) < 16:
        return None, ""
    order = "<" if data[1] & 1 else ">"
    seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", data, 4)
    frame = data[16 : 16 + max(length - 1, 0)].decode("utf-8", "replace")
    return (seconds * NS + nanoseconds) or None, frame


def _explanation(path: Path, error: Exception) -> str:
    said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    if isinstance(error, AssertionError | MemoryError) or any(word in said.lower() for word in _CUT):
        mend = "`mcap recover FILE -o NEW.mcap`" if _is_mcap(path) else '`sqlite3 FILE ".recover" | sqlite3 NEW.db3`'
        return f"{path} is cut off or damaged ({said}); {mend} saves what is intact, then import that file."
    if "profile" in said.lower():
        return (
            f"{path} is an MCAP file that was not recorded by ROS 2 ({said}); what is imported from MCAP is a bag of "
            "ROS 2, and recordings of dipac need no import."
        )
    if isinstance(error, UnicodeDecodeError) or "metadata" in said.lower() or "missing" in said.lower():
        return (
            f"{path} is no complete bag ({said}); `ros2 bag reindex FOLDER` writes its {METADATA} anew, or name one of "
            "its files instead of the folder."
        )
    if "serialization" in said.lower():
        return f"{path} cannot be read ({said}); messages in CDR are, as `ros2 bag record` writes them by default."
    return f"{path} cannot be read as a bag of ROS 2 ({said}); `ros2 bag info` says what it is."


def _is_mcap(path: Path) -> bool:
    return any(file.suffix == ".mcap" for file in ([path] if path.is_file() else path.glob("*.mcap")))


def _storage(path: Path) -> Path:
    """The bag's folder, or its only file where the folder has no metadata."""
    if path.is_dir() and not (path / METADATA).is_file():
        files = [file for file in path.iterdir() if file.suffix in SUFFIXES]
        if len(files) == 1:
            return files[0]
    return path


def is_bag(path: Path) -> bool:
    """True for a bag's folder, or a file that is named as one of its parts."""
    if path.is_dir():
        return (path / METADATA).is_file() or any(file.suffix in SUFFIXES for file in path.iterdir())
    return path.suffix in (*SUFFIXES, ".bag")


def open_bag(path: Path) -> Bag:
    """The bag, to be entered. Raises UsageError where it is one of ROS 1."""
    if path.suffix == ".bag":
        raise UsageError(
            f"{path} is a bag of ROS 1; `rosbags-convert --src {path.name} --dst {path.stem}` (of the package rosbags) "
            "makes one of ROS 2."
        )
    return Bag(path)


def _load() -> tuple[ModuleType, ModuleType]:
    try:
        from rosbags import rosbag2, typesys
    except ImportError as error:
        raise PreflightError(
            f"Bags of ROS 2 need the package {error.name!r}; install it with `pip install 'dipac[ros2]'`."
        ) from None
    return rosbag2, typesys
