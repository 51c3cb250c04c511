"""The operator console: shows messages, sends requests, computes nothing."""

import asyncio
import socket
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import final

import anyio
import viser
from anyio import to_thread

from app.config import Limits, Timing
from app.core.dialogue.requests import Request
from app.core.errors import PreflightError
from app.core.geometry.scene_description import Stage
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.messages import Message
from app.core.system.channel import Lossless
from app.ui.aim import TargetHandle
from app.ui.goals.goal_upload import GoalUpload
from app.ui.jog_socket import JogHandler, JogSocket
from app.ui.panel import Panel
from app.ui.parts import cards
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.session_keys import SessionKeys
from app.ui.playback import Playback
from app.ui.player import Player
from app.ui.server import proxy
from app.ui.server.access import LOOPBACK, Access
from app.ui.server.page import Cell, Page
from app.ui.server.tls import Tls
from app.ui.server.viser_host import ViserHost
from app.ui.view.render_loop import RenderLoop
from app.ui.view.scene import ConsoleScene

_REQUESTS_BOUND = 1000


@final
class Console:
    """An `Operator` that is a person at a browser."""

    def __init__(self, *, url: str, controller: OperatorController, requests: Lossless[Request]) -> None:
        self.url = url
        """Address to open; holds the token, so it is for the operator's eyes."""
        self._controller = controller
        self._requests = requests

    def show(self, message: Message) -> None:
        """Show a message to the operator. Never blocks: the painter picks it up."""
        self._controller.show(message)

    def reset(self, messages: Iterable[Message]) -> None:
        """Replace the shown state by these messages: a replay has jumped."""
        self._controller.reset(messages)

    async def requests(self) -> AsyncIterator[Request]:
        """The operator's requests, in order."""
        async for request in self._requests:
            yield request


@asynccontextmanager
async def open_console(
    *,
    host: str,
    port: int,
    title: str,
    cell: Cell,
    stop: Callable[[], None],
    limits: Limits | None = None,
    table: TablePlace = AT_BASE,
    stage: Stage | None = None,
    tls: Tls | None = None,
    hand: JogHandler | None = None,
    timing: Timing | None = None,
    player: Player | None = None,
) -> AsyncGenerator[Console]:
    """A console that serves until the block is left; `timing` has the limits that refuse plans, `limits` are drawn.

    `cell`: the kind of cell behind it; a replay has a `player`, whose clock gives ages. The arm's base is drawn at the
    `table`'s pose, and tool and fixtures as those of the `stage`. `stop` tells the arm to stop: it is called from other
    threads than the caller's and must not block.
    `hand` turns held controls into motion, where that is offered. `port` 0 takes a free one.

    Raises PreflightError where the port is taken, or `host` is no loopback address and there is no `tls`.
    """
    if host not in LOOPBACK and tls is None:
        raise PreflightError(
            f"Without TLS the console is served on loopback alone, not on {host!r}; to see it from another machine use "
            f"`ssh -L {port}:127.0.0.1:{port}`, or give --tls-cert and --tls-key."
        )
    try:
        listening = proxy.listen(host, port)
    except OSError as error:
        raise PreflightError(
            f"Port {port} on {host} cannot be had ({error.strerror}); choose another with --port."
        ) from None
    requests = Lossless[Request]("operator requests", bound=_REQUESTS_BOUND)
    controller = OperatorController(
        stop=stop,
        post=partial(_post, asyncio.get_running_loop(), requests),
        now=player.now if player else time.monotonic,
        replay=cell == "replay",
    )
    with listening:
        page = Page(title=title, cell=cell, jogging=hand is not None)
        session_keys = SessionKeys()
        line = (
            JogSocket(hand, session_keys, blocked_reason=controller.blocked_reason, refused=controller.turned_away)
            if hand
            else None
        )
        goal_upload = GoalUpload(controller, session_keys, controller.turned_away)
        where = {"limits": limits or Limits(), "timing": timing or Timing(), "table": table, "stage": stage}
        furnish = partial(
            _set_scene, controller=controller, session_keys=session_keys, line=line, hand=hand, player=player, **where
        )
        ways = {"goal": goal_upload.receive} | ({"jog": line.serve} if line else {})
        async with _serving(listening, controller, page, furnish, ways, tls) as url:
            yield Console(url=url, controller=controller, requests=requests)


def _post(loop: asyncio.AbstractEventLoop, requests: Lossless[Request], request: Request) -> None:
    """Hand a request to the program, from any thread; after the program's end it is dropped."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(requests.put_nowait, request)


@asynccontextmanager
async def _serving(
    listening: socket.socket,
    controller: OperatorController,
    page: Page,
    furnish: Callable[[ViserHost], RenderLoop],
    ways: Mapping[str, proxy.Handler],
    tls: Tls | None,
) -> AsyncGenerator[str]:
    """Viser, the painter and the proxy, started in this order and closed in the opposite one; yields the URL."""
    context = tls.context() if tls else None
    host, port = listening.getsockname()[:2]
    names = (*LOOPBACK, tls.name.lower()) if tls else LOOPBACK
    access = Access(token=proxy.fresh_secret(), cookie=f"dipac_{port}", names=names, secure=tls is not None)
    passphrase = proxy.fresh_secret()
    viser_host = await to_thread.run_sync(lambda: ViserHost(label=page.title, passphrase=passphrase))
    try:
        painter = await to_thread.run_sync(furnish, viser_host)
        front = proxy.Proxy(
            access=access,
            page=page,
            viser_port=viser_host.port,
            passphrase=passphrase,
            stop=controller.stop,
            understood=viser_host.takes,
            refused=controller.turned_away,
            ways=ways,
        )
        try:
            await _over_there(front.start(listening, context), viser_host)
            painter.start()
            address = tls.name if tls else f"[{host}]" if ":" in host else host
            yield f"{'https' if tls else 'http'}://{address}:{port}/?token={access.token}"
        finally:
            with anyio.CancelScope(shield=True):
                await to_thread.run_sync(painter.close)
                await _over_there(front.close(), viser_host)
    finally:
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(viser_host.close)


def _set_scene(
    viser_host: ViserHost,
    *,
    controller: OperatorController,
    session_keys: SessionKeys,
    line: JogSocket | None,
    hand: JogHandler | None,
    player: Player | None,
    limits: Limits,
    timing: Timing,
    table: TablePlace,
    stage: Stage | None,
) -> RenderLoop:
    """Build scene and panels on the server; returns their painter."""
    _greet(viser_host.server, controller, session_keys, line)
    scene = ConsoleScene(viser_host.server, limits, table, stage)
    panel = Panel(viser_host.server, controller, scene, timing)
    aim = TargetHandle(viser_host.server, limits.workspace, controller, hand) if hand else None
    playback = Playback(viser_host.server, player) if player else None

    def paint(state: ConsoleState, now_s: float) -> None:
        with viser_host.server.atomic():
            scene.paint(state, time.monotonic())  # The ghost goes on where the clock of a replay stands still.
            panel.paint(state, now_s)
            if aim is not None:
                aim.paint(state)
            if playback is not None:
                playback.paint()

    return RenderLoop(controller, paint)


def _greet(
    server: viser.ViserServer, controller: OperatorController, session_keys: SessionKeys, line: JogSocket | None
) -> None:
    """Tell each browser its name for control and records, and the controller when it leaves."""

    def came(client: viser.ClientHandle) -> None:
        name = f"client {client.client_id}"
        client.gui.add_html(cards.you(name, session_keys.issue(name)), order=-1.0)

    def left(client: viser.ClientHandle) -> None:
        name = f"client {client.client_id}"
        session_keys.revoke(name)
        controller.on_disconnect(name)
        if line is not None:
            line.disconnect(name)

    server.on_client_connect(came)
    server.on_client_disconnect(left)


async def _over_there(coroutine: Coroutine[None, None, None], viser_host: ViserHost) -> None:
    """Run a coroutine on viser's loop and wait for its end."""
    await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(coroutine, viser_host.server.get_event_loop()))
