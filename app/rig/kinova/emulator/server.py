"""Socket server of the emulated arm: frames over TCP and UDP on loopback, and the passage of time."""

import asyncio
import contextlib
import time
from collections.abc import Coroutine
from typing import Any, final

import numpy as np

from app.core.system.ring import Ring
from app.rig.kinova import gen3
from app.rig.kinova.api.errors import WireError
from app.rig.kinova.client.wire import FrameKind, KortexFrame, Splitter, decode_frame
from app.rig.kinova.emulator.firmware import Firmware

STATE = np.dtype(
    [("time_s", "f8"), ("joints", "f8", (7,)), ("velocity", "f8", (7,)), ("tool", "f8", (4, 4)), ("closed", "f8")]
)
"""True state: joints [rad], their speeds [rad/s], `T_base_tool` [m], and the closure of the fingers, 0 to 1."""

TICK_S, LONGEST_TICK_S = 0.010, 0.050
"""Longest step of the arm's time: after a later tick the arm lags, and does not jump."""
LOOPBACK = "127.0.0.1"
RESENT_S = 0.040
"""Delay of a retransmission on a stream: it follows the acknowledgement of the next segment, which comes 25 ms later
(RACK-TLP, RFC 8985)."""


@final
class Server:
    """Server that listens until its task is cancelled, on loopback alone: its password protects nothing."""

    def __init__(self, firmware: Firmware, states: Ring) -> None:
        self.firmware, self._states = firmware, states
        self.ports = (0, 0)
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._datagrams = 0
        self._chance = np.random.default_rng(0)

    async def open(self, udp_port: int = 0) -> None:
        """Listen on free ports, or on that one for UDP; `ports` are then those of TCP and UDP."""
        tcp = await asyncio.start_server(self._serve, LOOPBACK, 0)
        loop = asyncio.get_running_loop()
        self._udp, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(self), local_addr=(LOOPBACK, udp_port))
        self.ports = (tcp.sockets[0].getsockname()[1], self._udp.get_extra_info("sockname")[1])

    async def run(self) -> None:
        """Advance time, and send notifications to subscribers."""
        last = time.monotonic()
        while True:
            await asyncio.sleep(TICK_S)
            now = time.monotonic()
            self.firmware.tick(min(max(now - last, 1e-4), LONGEST_TICK_S))
            last = now
            self._publish(now)
            for session, frame in self.firmware.notifications():
                if isinstance(session.address, asyncio.StreamWriter):
                    self._send(session.address, frame)

    def _publish(self, now_s: float) -> None:
        """Publish the true state, for a world that follows the arm."""
        arm = self.firmware.arm
        self._states.append(
            time_s=now_s,
            joints=arm.joints,
            velocity=arm.velocity,
            tool=gen3.tool(arm.joints),
            closed=arm.fingers.position,
        )

    def cut(self) -> None:
        """Cut all connections over TCP, as if a cable was pulled and the peer's stack gave up."""
        for writer in tuple(self._writers):
            writer.transport.abort()

    def datagram(self, data: bytes, address: tuple[str, int]) -> None:
        """Answer a datagram, where it is a request."""
        with contextlib.suppress(WireError):
            frame = decode_frame(data)
            if frame.kind == FrameKind.REQUEST and not self.firmware.arm.adversity.deaf:
                self._in_background(self._answer_datagram(frame, address))

    async def _answer_datagram(self, frame: KortexFrame, address: tuple[str, int]) -> None:
        if self._lost():
            return
        answer, adversity = self.firmware.answer(frame, address), self.firmware.arm.adversity
        self._datagrams += 1
        if self._lost() or (adversity.lose_feedback and self._datagrams % adversity.lose_feedback):
            return
        if adversity.delay_s:
            await asyncio.sleep(adversity.delay_s)
        self._udp.sendto(answer.encode(), address)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a connection until it ends or its data are not of this protocol."""
        self._writers.add(writer)
        splitter = Splitter()
        try:
            while data := await reader.read(65536):
                for frame in map(decode_frame, splitter.feed(data)):
                    if late_s := self._late_s():
                        await asyncio.sleep(late_s)  # Later data wait as well.
                    if frame.kind == FrameKind.PING:
                        self._send(writer, KortexFrame(kind=FrameKind.PONG, message=frame.message))
                    elif frame.kind == FrameKind.REQUEST and not self.firmware.arm.adversity.deaf:
                        self._in_background(self._answer(frame, writer))
        except (WireError, ConnectionError, asyncio.CancelledError):
            pass  # A peer that is gone or speaks another protocol, or the end of the arm: it is closed below.
        finally:
            self._writers.discard(writer)
            writer.close()

    async def _answer(self, frame: KortexFrame, writer: asyncio.StreamWriter) -> None:
        """Answer a request; long ones are computed in a thread."""
        if self.firmware.slow(frame):
            answer = await asyncio.to_thread(self.firmware.answer, frame, writer)
        else:
            answer = self.firmware.answer(frame, writer)
        if delay_s := self.firmware.arm.adversity.delay_s + self._late_s():
            await asyncio.sleep(delay_s)
        self._send(writer, answer)

    def _lost(self) -> bool:
        """True where data sent now are lost."""
        return self._chance.random() < self.firmware.arm.adversity.loss

    def _late_s(self) -> float:
        """Delay of stream data sent now, until a retransmission arrives."""
        late_s = 0.0
        while self._lost():
            late_s += RESENT_S
        return late_s

    def _send(self, writer: asyncio.StreamWriter, frame: KortexFrame) -> None:
        if not writer.is_closing():
            writer.write(frame.encode_for_stream())

    def _in_background(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


@final
class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, server: Server) -> None:
        self._server = server

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Pass the datagram to the server."""
        self._server.datagram(data, addr)
