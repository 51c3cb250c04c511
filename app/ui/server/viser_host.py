"""Viser, started on a loopback port of its own that serves our proxy alone.

Viser has neither authentication nor an Origin check. Its websocket server calls back for each new connection before the
first byte is sent or read; there a connection without our passphrase, a header that only the proxy knows, is closed. An
outsider can still get viser's public client page from this port.

This is the only module that touches viser's private parts (1.1.1): `ViserServer._websock_server`,
`WebsockServer._live_connections`, `GuiApi._gui_input_handle_from_uuid` and `viser._messages`. Where a later version
renames them, starting fails; the door does not open.
"""

# pyright: reportPrivateUsage=false

import asyncio
import hmac
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager, redirect_stdout, suppress
from typing import Protocol, TextIO, cast, final

import viser
from viser._messages import GuiUpdateMessage, Message
from viser.infra import WebsockClientConnection
from websockets.exceptions import ConnectionClosed

PROXY_HEADER = "X-Dipac-Passphrase"
_POLICY_VIOLATION = 1008


@final
class ViserHost:
    """A running viser server behind a passphrase. Blocks while starting and stopping; use it from a thread."""

    def __init__(self, *, label: str, passphrase: str) -> None:
        with _mute(threading.get_ident()):
            self.server = _Unshared(host="127.0.0.1", port=0, label=label, verbose=False)
        self._passphrase = passphrase
        websockets = self.server._websock_server
        self._connections = websockets._live_connections
        self._widgets = self.server.gui._gui_input_handle_from_uuid
        websockets.on_client_connect(self._check)
        websockets.disconnect_all_clients()

    @property
    def port(self) -> int:
        """The loopback port assigned by the operating system."""
        return self.server.get_port()

    def close(self) -> None:
        """Stop serving."""
        thread = asyncio.run_coroutine_threadsafe(_current_thread(), self.server.get_event_loop()).result()
        with _mute(thread):
            self.server.stop()

    def takes(self, data: bytes) -> bool:
        """True where viser can parse a browser's message, and its value has the type of the widget's.

        Viser converts any value of a slider to a number, and prints a traceback where that fails.
        """
        if not can_parse(data):
            return False
        message = Message.deserialize(data)
        if not isinstance(message, GuiUpdateMessage) or "value" not in message.updates:
            return True
        widget = self._widgets.get(message.uuid)
        return widget is None or _alike(message.updates["value"], widget.value)

    async def _check(self, client: WebsockClientConnection) -> None:
        """Close a connection that did not come through the proxy, before any message passes."""
        connection = self._connections[client.client_id]
        given = connection.request.headers.get(PROXY_HEADER, "") if connection.request else ""
        if hmac.compare_digest(given.encode(), self._passphrase.encode()):
            return
        await connection.close(_POLICY_VIOLATION, "Open the console at its printed URL.")
        # Messages received before the closing are still queued, and viser would read them next.
        with suppress(ConnectionClosed):
            while True:
                await connection.recv()


@final
class _Unshared(viser.ViserServer):
    """Viser offers every client a public tunnel to itself; hiding the button does not withdraw the offer."""

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002 (viser's signature)
        """Refuse the tunnel."""
        return None


def can_parse(data: bytes) -> bool:
    """True where viser can parse a browser's message."""
    try:
        Message.deserialize(data)
    except Exception:  # Any error on foreign bytes here would occur when it reads them.
        return False
    return True


def _alike(value: object, held: object) -> bool:
    """True where `value` is a number for a held number, and a list of them for several."""
    if isinstance(held, tuple):
        known = cast(tuple[object, ...], held)
        return isinstance(value, list | tuple) and all(_alike(each, known[0]) for each in value if known)
    return not isinstance(held, int | float) or isinstance(value, int | float)


async def _current_thread() -> int:
    return threading.get_ident()


@contextmanager
def _mute(thread: int) -> Generator[None]:
    """Drop the output of one thread: viser announces its own port, which is not the operator's."""
    with redirect_stdout(cast(TextIO, _Without(thread, sys.stdout))):
        yield


class _Stream(Protocol):
    """The part of standard output that is needed."""

    def write(self, text: str, /) -> int:
        """Write."""
        ...


@final
class _Without:
    """A text stream that drops one thread's output and passes everything else on."""

    def __init__(self, thread: int, stream: _Stream) -> None:
        self._thread = thread
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, or drop the text of the muted thread."""
        return len(text) if threading.get_ident() == self._thread else self._stream.write(text)

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)
