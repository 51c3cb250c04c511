"""The console through its real servers: who gets in, and that STOP needs nobody's leave."""

import asyncio
import http.client
import socket
import sys
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import aiohttp
import anyio
import pytest
import viser
from aiohttp import web
from yarl import URL

from app.core.dialogue.control import Lease
from app.core.errors import PreflightError
from app.core.messages import Decision, StopRequest
from app.ui import Console, open_console
from app.ui.jog_socket import JogHandler
from app.ui.server.access import Access
from app.ui.server.page import Cell, Page
from app.ui.server.proxy import Proxy, listen
from app.ui.server.viser_host import PROXY_HEADER, ViserHost
from tests.ui import synthetic

pytestmark = pytest.mark.anyio

PROTOCOL = f"viser-v{viser.__version__}"
EVIL = "http://evil.example"


@dataclass
class Opened:
    """A console with a plan up for approval, and a browser of its operator that holds the cookie."""

    console: Console
    browser: aiohttp.ClientSession
    stopped: threading.Event = field(default_factory=threading.Event)

    @property
    def url(self) -> URL:
        return URL(self.console.url)

    @property
    def origin(self) -> str:
        return str(self.url.origin())


@asynccontextmanager
async def opened(*, cell: Cell = "simulated", hand: JogHandler | None = None) -> AsyncIterator[Opened]:
    stopped = threading.Event()
    async with (
        open_console(
            host="127.0.0.1",
            port=0,
            title="dipac <test>",
            cell=cell,
            stop=stopped.set,
            hand=hand,
        ) as console,
        # The jar must keep cookies for an address without a name, as browsers do.
        aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser,
    ):
        async with browser.get(console.url) as reply:
            assert reply.status == 200
        yield Opened(console=console, browser=browser, stopped=stopped)


async def test_the_printed_url_opens_the_page_with_its_banner_and_leaves_no_token_in_it():
    async with opened() as it, it.browser.get(it.origin) as reply:
        page = await reply.text()
        assert reply.status == 200
        assert "SIMULATED" in page
        assert "dipac &lt;test&gt;" in page
        assert it.url.query["token"] not in page
        assert reply.headers["X-Frame-Options"] == "DENY"


async def test_a_real_arm_is_announced_as_one():
    async with opened(cell="real") as it, it.browser.get(it.origin) as reply:
        page = await reply.text()
        assert "REAL ARM" in page
        assert "SIMULATED" not in page


async def test_recorded_images_are_announced_as_such_and_stop_works():
    async with opened(cell="replayed") as it:
        async with it.browser.get(it.origin) as reply:
            page = await reply.text()
        assert "RECORDED IMAGES" in page
        assert "SIMULATED" not in page
        assert "disabled" not in page.split('id="dp-stop"')[1].split(">")[0]


async def test_the_cookie_is_out_of_reach_for_scripts_and_other_sites():
    async with opened() as it, it.browser.get(it.console.url) as reply:
        (cookie,) = reply.cookies.values()
        assert cookie["httponly"]
        assert cookie["samesite"] == "Strict"


@pytest.mark.parametrize("path", ["/", "/?token=wrong", "/?token=", "/console.js", "/alive", "/index.html", "/nothing"])
async def test_nothing_is_served_without_the_token(path: str):
    async with opened() as it, aiohttp.ClientSession() as stranger, stranger.get(it.origin + path) as reply:
        assert reply.status == 403
        assert "Open the URL that the program printed" in await reply.text()


@pytest.mark.parametrize(
    "headers",
    [{}, {"Origin": EVIL}, {"Origin": "null"}, {"Host": "evil.example"}, {"Host": "evil.example", "Origin": EVIL}],
)
async def test_stop_is_refused_to_other_pages_and_names_even_with_the_cookie(headers: dict[str, str]):
    async with opened() as it, it.browser.post(f"{it.origin}/stop", headers=headers) as reply:
        assert reply.status == 403
        assert not it.stopped.is_set()


async def websocket_status(session: aiohttp.ClientSession, url: str, **headers: str) -> int:
    """The status with which a websocket is answered: 101 where it opens."""
    try:
        async with session.ws_connect(url, protocols=[PROTOCOL], headers=headers):
            return 101
    except aiohttp.WSServerHandshakeError as refusal:
        return refusal.status


async def test_the_websocket_opens_for_our_own_page_alone():
    async with opened() as it, aiohttp.ClientSession() as stranger:
        assert await websocket_status(it.browser, it.origin, Origin=it.origin) == 101
        assert await websocket_status(it.browser, it.origin, Origin=EVIL) == 403
        assert await websocket_status(it.browser, it.origin) == 403
        assert await websocket_status(it.browser, it.origin, Origin=it.origin, Host="evil.example") == 403
        assert await websocket_status(stranger, it.origin, Origin=it.origin) == 403
        assert await websocket_status(stranger, it.console.url, Origin=it.origin) == 403


async def test_the_websocket_carries_what_is_shown():
    async with opened() as it:
        for message in synthetic.scene():
            it.console.show(message)
        async with it.browser.ws_connect(
            it.origin, protocols=[PROTOCOL], headers={"Origin": it.origin}, max_msg_size=0
        ) as websocket:
            assert websocket.protocol == PROTOCOL
            received = 0
            with anyio.fail_after(20):
                while received < 20_000:
                    received += len(await websocket.receive_bytes())


@asynccontextmanager
async def viser_host() -> AsyncIterator[ViserHost]:
    stage = await anyio.to_thread.run_sync(lambda: ViserHost(label="test", passphrase="open sesame"))
    stage.server.gui.add_markdown("the secret of the cell")
    try:
        yield stage
    finally:
        await anyio.to_thread.run_sync(stage.close)


@pytest.mark.parametrize("headers", [{}, {PROXY_HEADER: ""}, {PROXY_HEADER: "wrong"}])
async def test_viser_itself_closes_on_who_did_not_come_through_the_proxy_before_it_says_anything(
    headers: dict[str, str],
):
    async with (
        viser_host() as stage,
        aiohttp.ClientSession() as session,
        session.ws_connect(f"http://127.0.0.1:{stage.port}/", protocols=[PROTOCOL], headers=headers) as websocket,
    ):
        await websocket.send_bytes(b"whatever was sent in a hurry")
        first = await websocket.receive(timeout=20)
        assert first.type is aiohttp.WSMsgType.CLOSE
        assert first.data == 1008
        assert stage.server.get_clients() == {}


async def test_viser_itself_answers_the_proxy():
    async with (
        viser_host() as stage,
        aiohttp.ClientSession() as session,
        session.ws_connect(
            f"http://127.0.0.1:{stage.port}/", protocols=[PROTOCOL], headers={PROXY_HEADER: "open sesame"}
        ) as websocket,
    ):
        assert len(await websocket.receive_bytes(timeout=20)) > 0


async def test_no_client_can_have_the_console_tunnelled_to_the_internet():
    async with viser_host() as stage:
        assert stage.server.request_share_url() is None


async def test_starting_and_stopping_print_no_address_but_ours(capsys: pytest.CaptureFixture[str]):
    async with opened():
        pass
    sys.stdout.write("others may still print\n")
    assert capsys.readouterr().out == "others may still print\n"


async def test_a_busy_port_is_said_with_its_number_and_the_option():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(PreflightError, match=rf"{port}.*--port") as caught:
            async with open_console(host="127.0.0.1", port=port, title="t", cell="simulated", stop=lambda: None):
                pass
        assert "\n" not in str(caught.value)


async def test_the_port_is_free_again_afterwards():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    for _ in range(2):
        async with open_console(host="127.0.0.1", port=port, title="t", cell="simulated", stop=lambda: None) as console:
            assert URL(console.url).port == port


async def test_the_console_is_not_served_beyond_this_machine():
    with pytest.raises(PreflightError, match="ssh -L"):
        async with open_console(host="0.0.0.0", port=0, title="t", cell="simulated", stop=lambda: None):
            pass


def press_stop(url: URL) -> int:
    """Press STOP from a thread, without any event loop; the status."""
    connection = http.client.HTTPConnection(url.host or "", url.port, timeout=20)
    cookie = f"dipac_{url.port}={url.query['token']}"
    connection.request("POST", "/stop", headers={"Origin": str(url.origin()), "Cookie": cookie})
    status = connection.getresponse().status
    connection.close()
    return status


async def test_stop_reaches_the_arm_while_the_event_loop_is_blocked_and_is_put_on_record_afterwards():
    async with opened() as it:
        pressing = threading.Thread(target=press_stop, args=(it.url,))
        pressing.start()
        # This blocks the loop on purpose: not a single callback of the program runs until the arm has been told.
        assert it.stopped.wait(20)
        requests = it.console.requests()
        with anyio.fail_after(20):
            request = await anext(requests)
        assert isinstance(request, StopRequest)
        assert "127.0.0.1" in request.operator
        await anyio.to_thread.run_sync(pressing.join)


async def test_a_stop_that_does_not_reach_the_arm_is_answered_with_an_error():
    def gone() -> None:
        raise OSError("the arm's process is gone")

    async with open_console(host="127.0.0.1", port=0, title="t", cell="simulated", stop=gone) as console:
        assert await anyio.to_thread.run_sync(press_stop, URL(console.url)) == 500


async def test_requests_come_in_the_order_of_the_presses():
    async with opened() as it:
        proposal = synthetic.proposal(synthetic.rope(0.5))
        it.console.show(proposal)
        await anyio.to_thread.run_sync(
            lambda: it.console._controller.decide(proposal, approve=False, operator="client 0", reason="no")
        )
        assert await anyio.to_thread.run_sync(press_stop, it.url) == 200
        requests = it.console.requests()
        with anyio.fail_after(20):
            kinds = [type(await anext(requests)) for _ in range(3)]
        assert kinds == [Lease, Decision, StopRequest]


async def test_a_client_that_does_not_read_makes_the_sender_wait_instead_of_filling_memory():
    sent = 0

    async def flood(request: web.Request) -> web.WebSocketResponse:
        nonlocal sent
        websocket = web.WebSocketResponse()
        await websocket.prepare(request)
        while not websocket.closed:
            await websocket.send_bytes(bytes(100_000))
            sent += 1
        return websocket

    async def page(_: web.Request) -> web.Response:
        return web.Response(text="<head></head><body></body>")

    async def route(request: web.Request) -> web.StreamResponse:
        return await (flood(request) if "Upgrade" in request.headers else page(request))

    source = web.Application()
    source.router.add_get("/", route)
    runner = web.AppRunner(source, shutdown_timeout=0.1)
    await runner.setup()
    listening = listen("127.0.0.1", 0)
    await web.SockSite(runner, listening).start()
    proxy = Proxy(
        access=Access(token="t", cookie="c"),
        page=Page(title="t", cell="simulated"),
        viser_port=listening.getsockname()[1],
        passphrase="p",
        stop=lambda operator: None,
        understood=lambda data: True,
        refused=lambda why: None,
        ways={},
    )
    front = listen("127.0.0.1", 0)
    await proxy.start(front)
    origin = f"http://127.0.0.1:{front.getsockname()[1]}"
    async with aiohttp.ClientSession(cookies={"c": "t"}, cookie_jar=aiohttp.CookieJar(unsafe=True)) as session:
        headers = {"Origin": origin, "Cookie": "c=t"}
        async with session.ws_connect(origin, headers=headers, max_msg_size=0) as websocket:
            await websocket.receive_bytes()
            before, unchanged = -1, 0
            with anyio.fail_after(60):
                while unchanged < 10:
                    unchanged = unchanged + 1 if sent == before else 0
                    before = sent
                    await asyncio.sleep(0.05)
            assert 0 < sent < 1000
    await proxy.close()
    await runner.cleanup()
