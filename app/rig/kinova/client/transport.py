"""Sockets that carry frames: a stream over TCP, datagrams over UDP."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from typing import Protocol, final

from app.rig.kinova.api.errors import LinkLost, WireError
from app.rig.kinova.client.wire import LONGEST_DATAGRAM, KortexFrame, Splitter, decode_frame

CONNECT_S, SEND_S = 3.0, 1.0


class Transport(Protocol):
    """Carrier of frames to and from an arm."""

    reliable: bool
    """True where sent frames arrive, or else the connection ends."""

    def send(self, frame: KortexFrame) -> None:
        """Send a frame. Raises LinkLost."""
        ...

    def frames(self) -> Iterator[KortexFrame]:
        """Received frames, until the connection ends. Raises LinkLost where it ends otherwise than by `close`."""
        ...

    def close(self) -> None:
        """Close it, which ends `frames`."""
        ...


@final
class TcpTransport:
    """A TCP stream. Raises LinkLost where nothing listens."""

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

    def send(self, frame: KortexFrame) -> None:
        """Send a complete frame; other threads' frames wait for it."""
        data = frame.encode_for_stream()
        with self._sending:
            try:
                self._socket.sendall(data)
            except OSError as error:
                raise LinkLost(f"The connection to the arm broke while sending ({error}).") from None

    def frames(self) -> Iterator[KortexFrame]:
        """Received frames, in order. Raises WireError where the stream is of another protocol."""
        splitter = Splitter()
        while (data := self._receive()) is not None:
            if not data:
                if self._closed:
                    return
                raise LinkLost("The arm closed the connection.")
            for each in splitter.feed(data):
                yield decode_frame(each)

    def _receive(self) -> bytes | None:
        """Received bytes, empty where the peer has closed, None where this side has."""
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
        """Close both directions, which wakes a waiting reader."""
        self._closed = True
        _shut(self._socket)


@final
class UdpTransport:
    """UDP datagrams, a frame each; invalid ones are counted in `garbled`."""

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

    def send(self, frame: KortexFrame) -> None:
        """Send a frame as one datagram."""
        try:
            self._socket.send(frame.encode())
        except OSError as error:
            raise LinkLost(f"A datagram to the arm could not be sent ({error}).") from None

    def frames(self) -> Iterator[KortexFrame]:
        """Received frames in order of arrival, some lost."""
        while not self._closed:
            try:
                data = self._socket.recv(LONGEST_DATAGRAM)
                if data:
                    yield decode_frame(data)
            except WireError:
                self.garbled += 1
            except TimeoutError:
                continue
            except OSError as error:
                if not self._closed:
                    raise LinkLost(f"Nobody takes datagrams at the arm any more ({error}).") from None

    def close(self) -> None:
        """Close it, which wakes a waiting reader."""
        self._closed = True
        _shut(self._socket)


def _shut(open_socket: socket.socket) -> None:
    """Wake a waiting reader, then close."""
    # A disconnected socket has no waiting reader.
    with contextlib.suppress(OSError):
        open_socket.shutdown(socket.SHUT_RDWR)
    open_socket.close()
