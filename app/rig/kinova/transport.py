"""Sockets that carry frames: a stream over TCP, datagrams over UDP."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from typing import Protocol, final

from app.rig.kinova.errors import LinkLost, WireError
from app.rig.kinova.wire import LONGEST_DATAGRAM, Frame, Splitter, decoded

CONNECT_S, SEND_S = 3.0, 1.0


class Transport(Protocol):
    """Carries frames to and from an arm."""

    reliable: bool
    """Whether what was sent arrives, or the connection ends."""

    def send(self, frame: Frame) -> None:
        """Send one. Raises LinkLost."""
        ...

    def frames(self) -> Iterator[Frame]:
        """What comes, for as long as the connection lasts. Raises LinkLost where it ends otherwise than by `close`."""
        ...

    def close(self) -> None:
        """End it; `frames` ends then, too."""
        ...


@final
class TcpTransport:
    """A stream. Raises LinkLost where nobody listens."""

    reliable = True

    def __init__(self, host: str, port: int) -> None:
        try:
            self._socket = socket.create_connection((host, port), timeout=CONNECT_S)
        except OSError as error:
            raise LinkLost(
                f"No arm answers at {host}, TCP port {port} ({error.strerror or error}); check its power, the cable "
                "and the address."
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(SEND_S)
        self._sending, self._closed = threading.Lock(), False

    def send(self, frame: Frame) -> None:
        """Whole, or not at all: another thread's frame waits for it."""
        data = frame.framed()
        with self._sending:
            try:
                self._socket.sendall(data)
            except OSError as error:
                raise LinkLost(f"The connection to the arm broke while sending ({error}).") from None

    def frames(self) -> Iterator[Frame]:
        """In order; WireError where the stream is of another protocol."""
        splitter = Splitter()
        while (data := self._received()) is not None:
            if not data:
                if self._closed:
                    return
                raise LinkLost("The arm closed the connection.")
            for each in splitter.feed(data):
                yield decoded(each)

    def _received(self) -> bytes | None:
        """What has come, nothing where the peer has closed, None where this side has."""
        while not self._closed:
            try:
                return self._socket.recv(65536)
            except TimeoutError:
                continue
            except OSError as error:
                if self._closed:
                    break
                raise LinkLost(f"The connection to the arm broke ({error}).") from None
        return None

    def close(self) -> None:
        """Of both directions, which wakes whoever waits."""
        self._closed = True
        _shut(self._socket)


@final
class UdpTransport:
    """Datagrams, each a frame; those that are none are counted in `garbled`."""

    reliable = False

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(SEND_S)
        self._closed, self.garbled = False, 0
        try:
            self._socket.connect((host, port))
        except OSError as error:
            self._socket.close()
            raise LinkLost(f"No way leads to {host}, UDP port {port} ({error.strerror or error}).") from None

    def send(self, frame: Frame) -> None:
        """One datagram."""
        try:
            self._socket.send(frame.encoded())
        except OSError as error:
            raise LinkLost(f"A datagram to the arm could not be sent ({error}).") from None

    def frames(self) -> Iterator[Frame]:
        """As they come, some lost."""
        while not self._closed:
            try:
                data = self._socket.recv(LONGEST_DATAGRAM)
                if data:
                    yield decoded(data)
            except WireError:
                self.garbled += 1
            except TimeoutError:
                continue
            except OSError as error:
                if not self._closed:
                    raise LinkLost(f"Nobody takes datagrams at the arm any more ({error}).") from None

    def close(self) -> None:
        """And wake whoever waits."""
        self._closed = True
        _shut(self._socket)


def _shut(open_socket: socket.socket) -> None:
    """Wake whoever reads, then close."""
    # Where it is not connected any more, nobody has to be woken.
    with contextlib.suppress(OSError):
        open_socket.shutdown(socket.SHUT_RDWR)
    open_socket.close()
