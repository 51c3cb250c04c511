"""A thousand hostile requests and messages: none is accepted, none crashes anything, nothing is asked of the arm."""

import asyncio
import math
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator

import aiohttp
import anyio
import msgspec
import numpy as np
import pytest
from yarl import URL

from app.core.messages import Notice
from tests.ui import synthetic
from tests.ui.test_console import EVIL, PROTOCOL, Opened, opened

pytestmark = pytest.mark.anyio

HUGE = 5 * 2**20
BEGINNINGS = (b"", b"GET / HTTP/1.1\r\n", b"POST /stop HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n")


async def http_status(session: aiohttp.ClientSession, method: str, url: URL | str, **options: object) -> int:
    async with session.request(method, url, **options) as reply:  # pyright: ignore[reportArgumentType]
        await reply.read()
        return reply.status


def strangers(it: Opened, rng: np.random.Generator) -> Iterator[tuple[str, dict[str, str]]]:
    """Requests of somebody without the token, from another page, or to another name."""
    token, name = it.url.query["token"], f"dipac_{it.url.port}"
    cookies = [
        "",
        f"{name}=",
        f"{name}={token[:-1]}",
        f"{name}={token}x",
        f"{name}={token.swapcase()}",
        f"other={token}",
    ]
    for method in ("GET", "POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
        for cookie in cookies:
            for path in ("/", "/stop", "/alive", "/assets/x.js", "/../../etc/passwd", f"/?token={token[::-1]}"):
                yield f"{method} {path}", {"Cookie": cookie, "Origin": it.origin}
    for origin in (EVIL, "null", f"{it.origin}.evil.example", "http://127.0.0.1:1", "https://127.0.0.1"):
        for path in ("POST /stop", "POST /", "GET /alive"):
            yield path, {"Cookie": f"{name}={token}", "Origin": origin}
    for _ in range(40):
        host = bytes(rng.integers(33, 127, 12, dtype=np.uint8)).decode()
        yield "POST /stop", {"Cookie": f"{name}={token}", "Origin": it.origin, "Host": host}


async def test_strangers_get_nothing_by_http() -> None:
    async with opened() as it, aiohttp.ClientSession() as stranger:
        counted = Counter[int]()
        for request, headers in strangers(it, np.random.default_rng(0)):
            method, path = request.split(" ", 1)
            url = URL(it.origin + path, encoded=True)
            counted[await http_status(stranger, method, url, headers=headers)] += 1
        assert sum(counted.values()) > 250
        # 400: aiohttp itself refuses a Host header that no host can have.
        assert set(counted) <= {400, 403}, counted
        await nothing_came_of_it(it)


async def test_strangers_get_no_websocket() -> None:
    async with opened() as it, aiohttp.ClientSession() as stranger:
        token, name = it.url.query["token"], f"dipac_{it.url.port}"
        right = {"Cookie": f"{name}={token}", "Origin": it.origin}
        wrong = [
            *({"Origin": it.origin, "Cookie": f"{name}={'x' * n}"} for n in range(60)),
            *(right | {"Origin": f"{EVIL}:{n}"} for n in range(30)),
            *(right | {"Host": f"{n}.evil.example"} for n in range(30)),
        ]
        for headers in wrong:
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await stranger.ws_connect(it.origin, protocols=[PROTOCOL], headers=headers)
            assert refused.value.status == 403
        await nothing_came_of_it(it)


def nonsense(rng: np.random.Generator) -> Iterator[bytes | str]:
    """Messages of somebody who has the token and no good intentions."""
    for _ in range(330):
        yield rng.bytes(int(rng.integers(0, 4000)))
    yield from ("text", "", '{"type": "GuiUpdateMessage"}', "\N{GREEK SMALL LETTER MU}" * 1000)
    kinds = ["ShareUrlRequest", "GuiUpdateMessage", "SceneNodeClickMessage", "RunJavascriptMessage", "x" * 10_000]
    for number in (math.nan, math.inf, -1, 2**63, 1e308):
        for kind in kinds:
            yield msgspec.msgpack.encode({"type": kind, "uuid": number, "updates": {"value": number}})
            yield msgspec.msgpack.encode({"type": kind, "updates": {str(number): [[number]] * 50}})
            yield msgspec.msgpack.encode([kind, number])
    yield bytes(HUGE)
    yield msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": "x" * HUGE}})
    for uuid in ("", "0", "../..", "approve", "\x00"):
        for updates in ({"value": True}, {"clicked": True}, {"__class__": 1}, {"value": {"a": 1}}, {}):
            # Well formed, of a widget that does not exist: viser passes over it.
            yield msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates})


async def test_messages_with_the_token_that_no_page_says_close_their_own_connection_alone() -> None:
    async with opened() as it:
        it.console.show(synthetic.proposal(synthetic.rope(0.5)))
        closed = 0
        for message in nonsense(np.random.default_rng(1)):
            async with it.browser.ws_connect(
                it.origin, protocols=[PROTOCOL], headers={"Origin": it.origin}, max_msg_size=0
            ) as websocket:
                try:
                    await (websocket.send_str(message) if isinstance(message, str) else websocket.send_bytes(message))
                    closed += await ends(websocket)
                except ConnectionError:  # A message beyond the limit is not even heard to its end.
                    closed += 1
        assert closed >= 400
        await nothing_came_of_it(it)


async def ends(websocket: aiohttp.ClientWebSocketResponse) -> bool:
    """Whether the other side hangs up within half a second of what was said."""
    with anyio.move_on_after(0.5):
        while True:
            answer = await websocket.receive()
            if answer.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.ERROR):
                return True
    return False


async def test_bytes_at_random_on_the_open_port_are_answered_or_hung_up_on() -> None:
    rng = np.random.default_rng(2)
    async with opened() as it:
        assert it.url.port is not None
        for count in range(260):
            reader, writer = await asyncio.open_connection("127.0.0.1", it.url.port)
            start = [b"", b"GET / HTTP/1.1\r\n", b"POST /stop HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n"][
                count % 3
            ]
            writer.write(start + rng.bytes(int(rng.integers(1, 3000))) + b"\r\n\r\n")
            with anyio.move_on_after(0.1):
                assert b"200 OK" not in await reader.read(4096)
            writer.close()
        await nothing_came_of_it(it)


async def test_a_crowd_is_turned_away_at_the_door_and_stop_still_works() -> None:
    async with opened() as it:
        held: list[aiohttp.ClientWebSocketResponse] = []
        statuses = Counter[int]()
        for _ in range(24):
            try:
                held.append(
                    await it.browser.ws_connect(
                        it.origin, protocols=[PROTOCOL], headers={"Origin": it.origin}, max_msg_size=0
                    )
                )
                statuses[101] += 1
            except aiohttp.WSServerHandshakeError as refused:
                statuses[refused.status] += 1
        assert statuses == {101: 16, 503: 8}
        assert await http_status(it.browser, "POST", f"{it.origin}/stop", headers={"Origin": it.origin}) == 200
        assert it.stopped.is_set()
        for websocket in held:
            await websocket.close()
        # Those who left make room.
        await until(lambda: can_join(it))


async def can_join(it: Opened) -> bool:
    try:
        async with it.browser.ws_connect(it.origin, protocols=[PROTOCOL], headers={"Origin": it.origin}):
            return True
    except aiohttp.WSServerHandshakeError:
        return False


async def until(holds: Callable[[], Awaitable[bool]]) -> None:
    for _ in range(300):
        if await holds():
            return
        await anyio.sleep(0.1)
    raise AssertionError("It did not come about in 30 s.")


async def nothing_came_of_it(it: Opened) -> None:
    """The page is served, the arm was told nothing, and nothing was asked but to put the refusals on record."""
    assert await http_status(it.browser, "GET", it.origin) == 200
    assert await can_join(it)
    assert not it.stopped.is_set()
    await anyio.sleep(0.1)
    while (request := it.console._requests.get_nowait()) is not None:
        assert isinstance(request, Notice)
        assert request.where == "door"
