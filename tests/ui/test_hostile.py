"""A thousand hostile requests and messages: none is accepted, none crashes anything, nothing is asked of the arm."""

import asyncio
import io
import json
import math
import re
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from typing import final

import aiohttp
import anyio
import msgspec
import numpy as np
import pytest
import zstandard
from yarl import URL

from app.config import Limits
from app.core.dialogue.control import Lease
from app.core.dialogue.jog import Jog
from app.core.messages import Notice, fresh_id
from app.core.motion import pointing_down
from app.teleop import Pilot
from tests.ui import synthetic
from tests.ui.test_console import EVIL, PROTOCOL, Opened, opened
from tests.ui.test_message_validation import CAMERA

pytestmark = pytest.mark.anyio

ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a compressed frame, as in viser's messages."""
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
    """True if the other side hangs up within half a second."""
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


async def test_a_request_that_is_none_is_answered_and_no_news_for_the_operator(caplog) -> None:
    async with opened() as it, aiohttp.ClientSession() as stranger:
        long = URL(f"{it.origin}/{'a' * 20_000}", encoded=True)
        assert await http_status(stranger, "GET", long) == 400
    assert caplog.records == []


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


@final
class Arm:
    """The hand of the console, through to an arm that notes what it is told."""

    def __init__(self) -> None:
        self.jogs: list[Jog] = []
        self.hand = Pilot(jog=self._jog, tool=lambda: pointing_down(np.array([0.5, 0.0, 0.2])), limits=Limits())

    def _jog(self, jog: Jog) -> bool:
        self.jogs.append(jog)
        return True


def sample(sequence: int = 0, **more: object) -> dict[str, object]:
    return {"axes": {"x": 1}, "held": True, "pressed": sequence + 1, "sequence": sequence, "speed": 1} | more


def poor_samples(rng: np.random.Generator) -> Iterator[bytes | str]:
    """Samples that no page sends over the line of a hand."""
    for number in ("NaN", "Infinity", "1e400", "-1e308", "2", '"1"', "null", "[1]", "{}", "true"):
        for field in ("x", "speed", "pressed", "sequence", "held"):
            if number == "2" and field in ("pressed", "sequence"):
                continue
            good = sample(axes={"x": "?"}) if field == "x" else sample() | {field: "?"}
            yield json.dumps(good).replace('"?"', "0.5" if (number, field) == ("true", "held") else number)
    yield from ("", "{}", "[]", "null", "[" * 900, '{"axes":' * 100, "x" * 1000, "\N{GREEK SMALL LETTER MU}" * 400)
    yield from (json.dumps(sample(frame="camera")), json.dumps(sample(more=1)), json.dumps(sample(axes={"w": 1})))
    for _ in range(100):
        yield rng.bytes(int(rng.integers(1, 900))).decode("latin-1")
    yield from (b"", b"bytes", json.dumps(sample()).encode(), json.dumps(sample()) + " " * 2000, "y" * HUGE)


@asynccontextmanager
async def commanded(arm: Arm) -> AsyncIterator[tuple[Opened, str]]:
    """A console in teleoperation, and the key of a page that has control."""
    async with opened(hand=arm.hand) as it:
        it.console.show(synthetic.mode("teleoperate"))
        async with page(it) as (key, _):
            it.console.show(lease("client 0"))
            yield it, key


@asynccontextmanager
async def page(it: Opened) -> AsyncIterator[tuple[str, aiohttp.ClientWebSocketResponse]]:
    """The key that the console sends a page, in the viser message that holds its name, and the page's websocket."""
    async with it.browser.ws_connect(
        it.origin, protocols=[PROTOCOL], headers={"Origin": it.origin}, max_msg_size=0
    ) as websocket:
        # A page has come once it has said where its camera is.
        await websocket.send_bytes(msgspec.msgpack.encode(CAMERA))
        with anyio.fail_after(20):
            while True:
                said = (await websocket.receive_bytes()).partition(ZSTD)
                text = zstandard.ZstdDecompressor().decompressobj().decompress(said[1] + said[2]) if said[1] else b""
                if found := re.search(rb'data-key="([^"]+)"', text):
                    yield found[1].decode(), websocket
                    return


def lease(holder: str) -> Lease:
    return Lease(id=fresh_id("lease"), time_s=time.monotonic(), holder=holder, why="in a test")


def line(it: Opened, **headers: str) -> AbstractAsyncContextManager[aiohttp.ClientWebSocketResponse]:
    return it.browser.ws_connect(f"{it.origin}/jog", headers={"Origin": it.origin} | headers)


async def told(hand: aiohttp.ClientWebSocketResponse) -> str:
    """Answer to a sample."""
    return (await hand.receive_json(timeout=5))["says"]


async def test_the_hand_of_whoever_has_control_reaches_the_arm() -> None:
    arm = Arm()
    async with commanded(arm) as (it, key), line(it) as hand:
        await hand.send_str(key)
        await hand.send_json(sample())
        assert await told(hand) == "moving"
        assert len(arm.jogs) == 1
        it.console.show(lease("client 9"))
        await hand.send_json(sample(1))
        assert await told(hand) == "client 9 has control"
        assert not arm.jogs[-1].linear.any()


def parcel(key: str, *files: tuple[str, bytes]) -> aiohttp.FormData:
    """A form with files as a page sends it."""
    form = aiohttp.FormData()
    form.add_field("key", key)
    form.add_field("camera", "left")
    for name, data in files:
        form.add_field("files", io.BytesIO(data), filename=name)
    return form


async def test_files_come_in_from_the_pages_of_this_run_alone_and_nonsense_asks_for_nothing() -> None:
    rng = np.random.default_rng(5)
    async with opened() as it, page(it) as (key, _), aiohttp.ClientSession() as stranger:
        goal, own = f"{it.origin}/goal", {"Origin": it.origin}
        async with stranger.post(goal, data=parcel(key), headers=own) as reply:
            assert reply.status == 403
        for headers in ({"Origin": EVIL}, {"Origin": "null"}, {"Host": "evil.example"}):
            async with it.browser.post(goal, data=parcel(key), headers=own | headers) as reply:
                assert reply.status == 403
        for wrong in ("", "client 0", key[:-1], key + "x"):
            async with it.browser.post(goal, data=parcel(wrong, ("a.npy", b"")), headers=own) as reply:
                assert reply.status == 403
        async with it.browser.post(goal, data=parcel(key, ("a.npy", bytes(40_000_000))), headers=own) as reply:
            assert reply.status == 413
        async with it.browser.post(goal, data=b"no form", headers=own) as reply:
            assert reply.status in (400, 403, 413)
        names = ("a.npy", "a.ply", "a.png", "../../etc/passwd", "<script>", "a" * 300)
        for count in range(60):
            files = [(str(rng.choice(names)), rng.bytes(int(rng.integers(0, 2000)))) for _ in range(count % 5)]
            async with it.browser.post(goal, data=parcel(key, *files), headers=own) as reply:
                assert reply.status == 200
                assert "give one .npy, .npz or .ply" in await reply.text()
        await nothing_came_of_it(it)


async def test_strangers_have_no_hand_on_the_arm() -> None:
    arm = Arm()
    async with commanded(arm) as (it, key), aiohttp.ClientSession() as stranger:
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await stranger.ws_connect(f"{it.origin}/jog", headers={"Origin": it.origin})
        assert refused.value.status == 403
        for headers in ({"Origin": EVIL}, {"Origin": "null"}, {"Host": "evil.example"}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await it.browser.ws_connect(f"{it.origin}/jog", headers={"Origin": it.origin} | headers)
            assert refused.value.status == 403
        for wrong in ("", "client 0", key[:-1], key + "x", key.swapcase(), "x" * 1000, json.dumps(sample())):
            async with line(it) as hand:
                await hand.send_str(wrong)
                await hand.send_json(sample())
                assert await ends(hand)
        async with line(it) as hand:
            await hand.send_bytes(key.encode())
            await hand.send_json(sample())
            assert await ends(hand)
        assert arm.jogs == []
        assert await http_status(it.browser, "POST", f"{it.origin}/stop", headers={"Origin": it.origin}) == 200


async def test_nothing_that_is_no_sample_reaches_the_arm() -> None:
    arm = Arm()
    async with commanded(arm) as (it, key):
        for poor in poor_samples(np.random.default_rng(4)):
            async with line(it) as hand:
                await hand.send_str(key)
                try:
                    await (hand.send_str(poor) if isinstance(poor, str) else hand.send_bytes(poor))
                    answer = await hand.receive(timeout=5)
                except ConnectionError:  # A message beyond the limit is not even heard to its end.
                    continue
                if answer.type is aiohttp.WSMsgType.TEXT:
                    assert "makes no sense" in answer.data
        assert arm.jogs == []


async def test_a_flood_of_samples_is_thinned_out_and_lines_beyond_sixteen_are_not_opened() -> None:
    arm = Arm()
    async with commanded(arm) as (it, key):
        async with line(it) as hand:
            await hand.send_str(key)
            for sequence in range(1000):
                await hand.send_json(sample(sequence, pressed=1))
            await anyio.sleep(0.3)
            assert 50 < len(arm.jogs) < 400
        held = [await it.browser.ws_connect(f"{it.origin}/jog", headers={"Origin": it.origin}) for _ in range(16)]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await it.browser.ws_connect(f"{it.origin}/jog", headers={"Origin": it.origin})
        assert refused.value.status == 503
        for one in held:
            await one.close()


async def test_a_page_has_one_line_and_it_ends_with_the_page() -> None:
    arm = Arm()
    async with opened(hand=arm.hand) as it:
        it.console.show(synthetic.mode("teleoperate"))
        async with AsyncExitStack() as lines:
            async with page(it) as (key, _):
                it.console.show(lease("client 0"))
                first, second = [await lines.enter_async_context(line(it)) for _ in range(2)]
                await first.send_str(key)
                await first.send_json(sample())
                assert await told(first) == "moving"
                await second.send_str(key)
                assert await ends(first)
                assert not arm.jogs[-1].linear.any()
                # The same press on a new line is none.
                await second.send_json(sample(5, pressed=1))
                assert "press again" in await told(second)
                await second.send_json(sample(6, pressed=2))
                assert await told(second) == "moving"
            assert await ends(second)
            assert not arm.jogs[-1].linear.any()
            jogs = len(arm.jogs)
            late = await lines.enter_async_context(line(it))
            await late.send_str(key)
            await late.send_json(sample(9))
            assert await ends(late)
            assert len(arm.jogs) == jogs


async def test_the_handle_is_dragged_by_whoever_has_control_alone_and_no_further_than_the_workspace() -> None:
    arm = Arm()
    drag = {"type": "TransformControlsUpdateMessage", "name": "/aim", "wxyz": [1.0, 0.0, 0.0, 0.0], "owner": ""}
    async with opened(hand=arm.hand) as it:
        it.console.show(synthetic.arm())
        it.console.show(synthetic.mode("teleoperate"))
        async with page(it) as (key, holder), page(it) as (_, watcher), line(it) as hand:
            it.console.show(lease("client 0"))
            await hand.send_str(key)

            async def goes(sequence: int) -> np.ndarray:
                """Velocity that the arm is told while "Go there" is held."""
                await hand.send_json(sample(sequence, towards=True))
                await hand.receive_str(timeout=5)
                return arm.jogs[-1].linear

            # At first it is where the tool was: below and beside where this arm has it.
            await anyio.sleep(0.5)
            assert (await goes(0))[1] < 0
            await watcher.send_bytes(msgspec.msgpack.encode(drag | {"position": [0.5, 0.3, 0.2]}))
            await anyio.sleep(0.5)
            assert (await goes(1))[1] < 0
            await holder.send_bytes(msgspec.msgpack.encode(drag | {"position": [0.5, 2.9, 0.2]}))
            await anyio.sleep(0.5)
            assert await goes(2) == pytest.approx([0.0, Limits().speed_m_s, 0.0])


async def test_a_console_without_a_hand_has_no_line_for_one() -> None:
    async with opened() as it:
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await it.browser.ws_connect(f"{it.origin}/jog", headers={"Origin": it.origin})
