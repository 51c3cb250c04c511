"""Emulated arm in a process of its own, with remote fault injection."""

import asyncio
import json
from dataclasses import asdict
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self, final

from app.core.errors import DeviceError
from app.core.system.processes import ask_for_real_time
from app.core.system.ring import SPAWN, Ring
from app.core.system.signals import leave_end_to_parent
from app.rig.kinova import gen3
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.firmware import Firmware
from app.rig.kinova.emulator.server import LOOPBACK, STATE, Server

_ANSWER_S, _START_S, _END_S = 5.0, 60.0, 5.0
_KEPT = 1024
"""Capacity of the ring of states, one every 10 ms."""


@final
class FakeProcess:
    """Process that starts on entry and ends on leaving, or with the process that started it.

    `states` holds its true state, one record a tick, for a world that follows it (`server.STATE`). A `udp_port` of 0 is
    any free one; Kinova's client accepts 10001 alone.
    """

    def __init__(self, *, udp_port: int = 0) -> None:
        self.host, self.ports = LOOPBACK, (0, 0)
        self.states = Ring(STATE, _KEPT)
        self._ours, theirs = SPAWN.Pipe()
        self._process = SPAWN.Process(
            target=run, args=(theirs, self.states, udp_port), name="dipac fake arm", daemon=True
        )
        self._theirs = theirs

    def __enter__(self) -> Self:
        """Start it. Raises DeviceError where it does not start."""
        self._process.start()
        # The process alone keeps its end, so that either side notices when the other is gone.
        self._theirs.close()
        tcp, udp = self._heard(_START_S)
        self.ports = (int(tcp), int(udp))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ours.close()
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid or 0

    def set(self, adversity: FaultInjection) -> None:
        """Set the injected faults, in place of earlier ones."""
        self._ask("set", **asdict(adversity))

    def fail(self, *, base: int = 0, joint: int = 0, bits: int = 0, lasting: bool = False) -> None:
        """Set bits of the arm's fault banks; `lasting` ones cannot be cleared before the next call without."""
        self._ask("fail", base=base, joint=joint, bits=bits, lasting=lasting)

    def take_over(self, speed_m_s: float) -> None:
        """Have another session take control and move the tool upwards until stopped; `set` gives control back."""
        self._ask("take over", speed_m_s=speed_m_s)

    def cut(self) -> None:
        """Cut all connections over TCP."""
        self._ask("cut")

    def reset(self) -> None:
        """Replace the arm by a new one at its start, without connections."""
        self._ask("reset")

    def commands(self) -> list[dict[str, Any]]:
        """Record of received commands, each as a plain `Told`."""
        return self._ask("commands")

    def look(self) -> dict[str, Any]:
        """True state: `joints` [rad], `tool` [m], `fingers`, `current_ma`, `moving`, `state`, `sessions`."""
        return self._ask("look")

    def _ask(self, what: str, **values: object) -> Any:
        self._ours.send_bytes(json.dumps({"what": what, "values": values}).encode())
        return self._heard(_ANSWER_S)

    def _heard(self, timeout_s: float) -> Any:
        if not self._ours.poll(timeout_s):
            raise DeviceError(f"The simulated arm did not answer in {timeout_s:.0f} s; start it again.")
        try:
            return json.loads(self._ours.recv_bytes())
        except EOFError:
            raise DeviceError("The simulated arm's process has ended; start it again.") from None


def run(control: Connection, states: Ring, udp_port: int) -> None:
    """The body of the process: serve until the other end of `control` is closed."""
    leave_end_to_parent()
    # Real firmware has a machine of its own: load on this one must not delay it.
    ask_for_real_time()
    asyncio.run(_serve(control, states, udp_port))


async def _serve(control: Connection, states: Ring, udp_port: int) -> None:
    server, over, loop = Server(Firmware(), states), asyncio.Event(), asyncio.get_running_loop()
    await server.open(udp_port)

    def heard() -> None:
        try:
            request = json.loads(control.recv_bytes())
        except (EOFError, OSError):
            loop.remove_reader(control.fileno())
            over.set()
            return
        control.send_bytes(json.dumps(_done(server, request["what"], request["values"])).encode())

    loop.add_reader(control.fileno(), heard)
    control.send_bytes(json.dumps(server.ports).encode())
    passing = loop.create_task(server.run())
    await over.wait()
    passing.cancel()


def _done(server: Server, what: str, values: dict[str, Any]) -> object:
    """Execute a request of the parent; returns the answer."""
    firmware = server.firmware
    match what:
        case "set":
            firmware.arm.adversity = FaultInjection(**values)
        case "fail":
            firmware.arm.fail(**values)
        case "take over":
            firmware.arm.take_over(**values)
        case "cut":
            server.cut()
        case "reset":
            server.cut()
            server.firmware = Firmware()
        case "commands":
            return firmware.record.plain()
        case _:
            return _look(firmware)
    return None


def _look(firmware: Firmware) -> dict[str, object]:
    arm = firmware.arm
    return {
        "joints": arm.joints.tolist(),
        "tool": gen3.tool(arm.joints)[:3, 3].tolist(),
        "fingers": arm.fingers.position,
        "current_ma": arm.fingers.current_ma,
        "moving": arm.moving,
        "state": int(arm.state),
        "sessions": [session.number for session in firmware.sessions],
    }
