"""Reverse proxy that admits the holder of the token to viser, and nobody else.

It runs on viser's own event loop and thread, so that STOP gets through while the program's loop is busy or blocked.
"""

import logging
import re
import secrets
import socket
import ssl
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import Literal, final

import aiohttp
import anyio
from aiohttp import web
from aiohttp.http import HttpProcessingError

from app.ui.parts.rate_limiter import RateLimiter
from app.ui.server.access import Access
from app.ui.server.message_validation import BURST, MOST_BYTES, STEADY_HZ, refusal
from app.ui.server.page import ASSETS, ENTERING, Page, refusal_page
from app.ui.server.viser_host import PROXY_HEADER

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

_HEARTBEAT_S = 20.0
_RELAY_CHUNK_BYTES = 64 * 1024
_MOST_BROWSERS, _MOST_REQUESTS = 16, 64
"""Limits of concurrent connections. A page of viser's requests about ten files at once."""
MOST_SENT_BYTES = 32 * 1024 * 1024
"""Size limit of a form with files."""
_REFUSED = 1008
"""WebSocket: policy violation."""
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'; form-action 'none'; base-uri 'none'; "
    "connect-src 'self' data: blob:",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def _is_defect(record: logging.LogRecord) -> bool:
    """True for what is wrong in this program. A request that is none is answered with 400, and is no news here."""
    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError))


_LOG = logging.getLogger(__name__)
_LOG.addFilter(_is_defect)


@final
class Proxy:
    """Serves one viser server on one listening socket. Start and close it on the loop it is to live on.

    `stop` is called with the operator's name in the handler of the STOP request itself; it must not block.
    `understood`: True where viser can parse a message; `refused` receives the reasons of refused requests; `ways` are
    the handlers that bypass viser, by path.
    """

    def __init__(
        self,
        *,
        access: Access,
        page: Page,
        viser_port: int,
        passphrase: str,
        stop: Callable[[str], None],
        understood: Callable[[bytes], bool],
        refused: Callable[[str], None],
        ways: Mapping[str, Handler],
    ) -> None:
        self._ways = ways
        self._understood, self._refused = understood, refused
        self._browsers = self._requests = 0
        self._access = access
        self._page = page
        self._viser = f"127.0.0.1:{viser_port}"
        self._passphrase = passphrase
        self._stop = stop
        self._session: aiohttp.ClientSession | None = None
        self._runner: web.AppRunner | None = None
        self._html = b""

    async def start(self, listening: socket.socket, tls: ssl.SSLContext | None = None) -> None:
        """Fetch viser's page and serve it inside ours."""
        self._session = aiohttp.ClientSession(auto_decompress=False, headers={PROXY_HEADER: self._passphrase})
        async with self._session.get(f"http://{self._viser}/", headers={"Accept-Encoding": "identity"}) as reply:
            self._html = self._page.around(await reply.read())
        application = web.Application(middlewares=[self._admit], client_max_size=MOST_SENT_BYTES)
        application.router.add_get("/", self._enter)
        application.router.add_post("/stop", self._press_stop)
        application.router.add_get("/alive", self._answer)
        for path, handler in self._ways.items():
            application.router.add_route("*", f"/{path}", handler)
        application.router.add_get("/{path:.*}", self._relay_http)
        self._runner = web.AppRunner(application, access_log=None, logger=_LOG, shutdown_timeout=1.0)
        await self._runner.setup()
        await web.SockSite(self._runner, listening, ssl_context=tls).start()

    async def close(self) -> None:
        """Stop serving and disconnect."""
        if self._runner is not None:
            await self._runner.cleanup()
        if self._session is not None:
            await self._session.close()

    @web.middleware
    async def _admit(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Serve a 403 page without the token; turn a token in the URL into a cookie."""
        cookie = request.cookies.get(self._access.cookie)
        acts = request.method != "GET" or _upgrades(request)
        origin = request.headers.get("Origin")
        if request.method == "GET" and not acts and self._access.knows(request.query.get("token")):
            cookie = self._access.token
        why = self._access.refusal(host=request.host, origin=origin, cookie=cookie, acts=acts)
        if why is not None:
            self._refused(why)
            return web.Response(status=403, text=refusal_page(why), content_type="text/html", headers=_HEADERS)
        if request.path in ("/", "/jog") and _upgrades(request):
            return await handler(request)  # A page that stays open; those are counted separately.
        if self._requests >= _MOST_REQUESTS and request.path != "/stop":
            self._refused("Too many requests at a time.")
            return web.Response(status=503, text="Too many requests at a time.", headers=_HEADERS)
        self._requests += 1
        try:
            return await handler(request)
        finally:
            self._requests -= 1

    async def _enter(self, request: web.Request) -> web.StreamResponse:
        """Serve the page, its websocket, or the step from the printed URL to the page."""
        if _upgrades(request):
            return await self._relay_websocket(request)
        if "token" not in request.query:
            return web.Response(body=self._html, content_type="text/html", charset="utf-8", headers=_HEADERS)
        # A page, not a redirect: after a link from elsewhere a redirect would not carry a SameSite=Strict cookie.
        entering = web.Response(text=ENTERING, content_type="text/html", headers=_HEADERS)
        entering.set_cookie(
            self._access.cookie,
            self._access.token,
            httponly=True,
            samesite="Strict",
            path="/",
            secure=self._access.secure,
        )
        return entering

    async def _press_stop(self, request: web.Request) -> web.StreamResponse:
        self._stop(f"browser at {request.remote}")
        return web.json_response({"stopped": True}, headers=_HEADERS)

    async def _answer(self, _: web.Request) -> web.StreamResponse:
        return web.Response(status=204, headers=_HEADERS)

    async def _relay_http(self, request: web.Request) -> web.StreamResponse:
        """Serve our style sheet and script, else viser's file under that path."""
        name = request.match_info["path"]
        if name in ASSETS:
            return web.Response(body=ASSETS[name].body, content_type=ASSETS[name].kind, headers=_HEADERS)
        assert self._session is not None
        async with self._session.get(f"http://{self._viser}{request.rel_url.raw_path}") as reply:
            kept = {k: v for k, v in reply.headers.items() if k in ("Content-Type", "Content-Encoding")}
            response = web.StreamResponse(status=reply.status, headers={**kept, **_HEADERS})
            await response.prepare(request)
            async for chunk in reply.content.iter_chunked(_RELAY_CHUNK_BYTES):
                await response.write(chunk)
        return response

    async def _relay_websocket(self, request: web.Request) -> web.StreamResponse:
        """Relay both ways until either side disconnects; each direction waits for its receiver."""
        assert self._session is not None
        if self._browsers >= _MOST_BROWSERS:
            self._refused("Too many browsers at a time.")
            return web.Response(status=503, text="Too many browsers at a time.", headers=_HEADERS)
        self._browsers += 1
        try:
            return await self._relay(request, self._session)
        finally:
            self._browsers -= 1

    async def _relay(self, request: web.Request, session: aiohttp.ClientSession) -> web.StreamResponse:
        offered = re.split(r",\s*", request.headers.get("Sec-WebSocket-Protocol", ""))
        async with session.ws_connect(f"ws://{self._viser}/", protocols=offered, max_msg_size=0) as viser:
            browser = web.WebSocketResponse(
                protocols=offered, max_msg_size=MOST_BYTES, heartbeat=_HEARTBEAT_S, compress=False
            )
            await browser.prepare(request)
            async with anyio.create_task_group() as directions:
                directions.start_soon(_pump, viser, browser, directions.cancel_scope)
                directions.start_soon(self._hear, browser, viser, directions.cancel_scope)
            with anyio.CancelScope(shield=True), anyio.move_on_after(1.0):
                await browser.close()
        return browser

    async def _hear(
        self, browser: web.WebSocketResponse, viser: aiohttp.ClientWebSocketResponse, hang_up: anyio.CancelScope
    ) -> None:
        """Pass on a browser's permitted messages within its rate limit; disconnect at the first other one."""
        pace = RateLimiter(time.monotonic(), steady_hz=STEADY_HZ, burst=BURST)
        try:
            async for message in browser:
                why = "it is no message"
                if message.type is aiohttp.WSMsgType.BINARY:
                    why = refusal(message.data, self._understood)
                if why is not None:
                    self._refused(f"A message through the websocket was refused: {why}.")
                    await browser.close(code=_REFUSED, message=why.encode())
                    break
                await viser.send_bytes(message.data)
                await anyio.sleep(pace.wait_s(time.monotonic()))
        except ConnectionError:
            # Either side hung up in the middle of a message, as a closed tab does.
            pass
        hang_up.cancel()


Socket = aiohttp.ClientWebSocketResponse | web.WebSocketResponse


async def _pump(source: Socket, sink: Socket, hang_up: anyio.CancelScope) -> None:
    """Pass messages on until the source ends or the sink is gone."""
    try:
        async for message in source:
            if message.type is aiohttp.WSMsgType.BINARY:
                await sink.send_bytes(message.data)
            elif message.type is aiohttp.WSMsgType.TEXT:
                await sink.send_str(message.data)
    except ConnectionError:
        # The sink hung up in the middle of a message, as a closed tab does.
        pass
    hang_up.cancel()


def _upgrades(request: web.Request) -> bool:
    return request.headers.get("Upgrade", "").lower() == "websocket"


def fresh_secret() -> str:
    """256 random bits for a URL or a header."""
    return secrets.token_urlsafe(32)


def listen(host: Literal["127.0.0.1", "localhost", "::1"] | str, port: int) -> socket.socket:
    """A listening socket on exactly this port.

    Raises OSError where the port is taken: two consoles must not share it by chance.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen()
        listening.setblocking(False)
    except OSError:
        listening.close()
        raise
    return listening
