"""An episode in a file of another program: poses of the tool, and moments at which the object can be looked at."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from jaxtyping import Float64, UInt8

from app.core.messages import Frame
from app.core.types import Cloud
from app.recording.exchange.npz_import import Poseline
from app.recording.exchange.streams.stream_list import StreamList
from app.recording.exchange.streams.stream_map import StreamMap


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class SceneView:
    """One moment in the base's frame: images with their cameras, or points with their colours.

    `is_object`: true where all points are the object's.
    """

    frames: tuple[Frame, ...] = ()
    points: Cloud
    colours: UInt8[np.ndarray, "M 3"] | None = None
    is_object: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredEpisode:
    """One run, its times in seconds from its beginning and its poses in the base's frame.

    `state`: the tool's tip as measured, `command`: as commanded; one of them at least. `moments_s`: when the object
    was seen; `look` reads what was seen at one of them. `began_ns`: the beginning, in nanoseconds since 1970 UTC, 0
    where the file does not say it.
    """

    state: Poseline | None
    command: Poseline | None
    moments_s: Float64[np.ndarray, " V"]
    began_ns: int = 0
    look: Callable[[float], SceneView]

    @property
    def tool(self) -> Poseline:
        """The tool's poses as measured, or as commanded where nobody measured them."""
        line = self.state or self.command
        assert line is not None
        return line


class ForeignSource(Protocol):
    """An opened file of another program."""

    @property
    def stream_list(self) -> StreamList:
        """List of its streams."""
        ...

    def guess(self) -> StreamMap:
        """Mapping by the types and names of the streams."""
        ...

    def episodes(self, streams: StreamMap) -> list[MeasuredEpisode]:
        """The episodes that the mapping selects; their images are read when they are looked at.

        Raises RecordingError, which names the stream and the next step, where the mapping or the data do not suffice.
        """
        ...
