"""Jog socket from a page to the arm: a websocket of its own, past viser and the program's event loop.

Each browser has a key of its own with its name, which identifies its jogs.
"""

import asyncio
import time
from collections.abc import Callable
from typing import Final, Protocol, final

import aiohttp
import anyio
from aiohttp import web
from jaxtyping import Float64
from numpy import ndarray

from app.core.types import ToolPose
from app.ui.parts.rate_limiter import RateLimiter
from app.ui.parts.session_keys import SessionKeys

_MOST_BYTES: Final = 1024
_STEADY_HZ, _BURST = 60.0, 120.0
_MOST_LINES: Final = 16
_INTRODUCTION_S: Final = 5.0
_HEARTBEAT_S: Final = 20.0
_CLOSING_S: Final = 1.0
"""Time limit for closing a browser's connection, which delays its next one."""
_REFUSED: Final = 1008
"""WebSocket: policy violation."""


class JogHandler(Protocol):
    """Executor of the operators' held controls. Called by viser's threads; nothing of it may block."""

    def sample(self, operator: str, data: bytes, *, refused: str | None) -> str:
        """Execute a browser's sample, unless `refused` gives a reason; returns its effect or the reason, in words."""
        ...

    def tool(self) -> ToolPose:
        """Pose of the tool."""
        ...

    def let_go(self, operator: str) -> None:
        """Release the controls of a browser that has left."""
        ...

    def aim(self, position: Float64[ndarray, "3"]) -> None:
        """Set the target [m] of "Go there"."""
        ...


@final
class JogSocket:
    """Serves `/jog`: a browser's key first, then samples; each is answered by its effect and the tool's position.

    `blocked_reason` returns the reason why an operator may not jog now, or None; `refused` receives the reasons of
    refused connections.
    """

    def __init__(
        self,
        hand: JogHandler,
        session_keys: SessionKeys,
        *,
        blocked_reason: Callable[[str], str | None],
        refused: Callable[[str], None],
    ) -> None:
        self._hand, self._session_keys = hand, session_keys
        self._blocked_reason, self._refused = blocked_reason, refused
        self._open: dict[str, web.WebSocketResponse] = {}
        self._count = 0
        self._loop: asyncio.AbstractEventLoop | None = None

    def disconnect(self, operator: str) -> None:
        """Close the connection of a browser that has left. From any thread."""
        websocket = self._open.get(operator)
        if websocket is not None and self._loop is not None:
            self._hand.let_go(operator)
            asyncio.run_coroutine_threadsafe(websocket.close(), self._loop)

    async def serve(self, request: web.Request) -> web.StreamResponse:
        """Serve one browser until either side disconnects; a new connection of the same browser ends the old one."""
        if self._count >= _MOST_LINES:
            self._refused("Too many browsers at a time.")
            return web.Response(status=503, text="Too many browsers at a time.")
        self._loop = asyncio.get_running_loop()
        self._count += 1
        try:
            websocket = web.WebSocketResponse(
                max_msg_size=_MOST_BYTES, heartbeat=_HEARTBEAT_S, timeout=_CLOSING_S, compress=False
            )
            await websocket.prepare(request)
            await self._talk(websocket)
            with anyio.CancelScope(shield=True), anyio.move_on_after(1.0):
                await websocket.close()
            return websocket
        finally:
            self._count -= 1

    async def _talk(self, websocket: web.WebSocketResponse) -> None:
        key = await _introduction(websocket)
        operator = self._session_keys.owner(key)
        if operator is None:
            await self._refuse(websocket, "it does not say by a key whose hand it is")
            return
        former, self._open[operator] = self._open.get(operator), websocket
        if former is not None:
            self._hand.let_go(operator)
            await former.close()
        try:
            await self._hear(key, operator, websocket)
        except ConnectionError:
            # The browser hung up in the middle of a message, as a closed tab does.
            pass
        finally:
            if self._open.get(operator) is websocket:
                del self._open[operator]
                self._hand.let_go(operator)

    async def _hear(self, key: str, operator: str, websocket: web.WebSocketResponse) -> None:
        """Pass on each sample at once; those beyond the rate of a page are dropped, as late ones are worthless."""
        pace = RateLimiter(time.monotonic(), steady_hz=_STEADY_HZ, burst=_BURST)
        async for message in websocket:
            if self._session_keys.owner(key) is None:
                return
            if message.type is not aiohttp.WSMsgType.TEXT:
                await self._refuse(websocket, "it is no sample of what is held")
                return
            if pace.allows(time.monotonic()):
                data = message.data.encode(errors="replace")
                says = self._hand.sample(operator, data, refused=self._blocked_reason(operator))
                await websocket.send_json({"says": says, "at": self._hand.tool()[:3].tolist()})

    async def _refuse(self, websocket: web.WebSocketResponse, why: str) -> None:
        self._refused(f"A hand on the arm was refused: {why}.")
        await websocket.close(code=_REFUSED, message=why.encode())


async def _introduction(websocket: web.WebSocketResponse) -> str:
    """The key that a page sends first, empty where none comes."""
    with anyio.move_on_after(_INTRODUCTION_S):
        message = await websocket.receive()
        if message.type is aiohttp.WSMsgType.TEXT:
            return message.data
    return ""
