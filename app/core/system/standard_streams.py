"""Standard input and output of the program: closed, without a reader, on a full disk, or in a narrow encoding."""

import io
import os
import sys
from typing import TYPE_CHECKING, Final, Protocol, final

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_STREAMS: Final = (0, 1, 2)


@final
class OutputRefused(OSError):
    """Standard output or standard error takes no more text."""


class DescribedFile(Protocol):
    """A stream with a file descriptor."""

    def fileno(self) -> int:
        """Its file descriptor. Raises OSError where it has none."""
        ...


def prepare_streams() -> None:
    """Make the standard streams accept every character, say that it was them where they fail, and replace closed ones.

    A closed stream's number would go to the next file that is opened, and libraries that print would write into it.
    """
    for number in _STREAMS:
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # The lowest free number, which is this one.
    if sys.stdout is sys.__stdout__:
        sys.stdout = _printing(1, sys.__stdout__)
    if sys.stderr is sys.__stderr__:
        sys.stderr = _printing(2, sys.__stderr__)


def silence(stream: DescribedFile) -> None:
    """Drop what is printed to `stream` from now on; one that is no file stays as it is."""
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, stream.fileno())
    except (OSError, AttributeError):
        pass
    finally:
        os.close(null)


@final
class _Printed(io.FileIO):
    """The file behind a standard stream."""

    def write(self, data: "ReadableBuffer", /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            raise OutputRefused(error.errno, error.strerror) from error


def _printing(number: int, before: object) -> io.TextIOWrapper:
    """The stream that replaces `before`, None where it was closed."""
    file = _Printed(number, "w", closefd=False)
    if not isinstance(before, io.TextIOWrapper):
        return io.TextIOWrapper(io.BufferedWriter(file), errors="replace")
    return io.TextIOWrapper(
        file if before.write_through else io.BufferedWriter(file),  # pyright: ignore[reportArgumentType] - as `python -u`
        encoding=before.encoding,
        errors="replace",
        line_buffering=before.line_buffering,
        write_through=before.write_through,
    )
