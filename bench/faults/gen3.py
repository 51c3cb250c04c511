"""Faults of the application, the network and the arm, with an emulated Gen3: `python -m bench.faults.gen3`."""

import sys
from collections.abc import Sequence
from functools import partial
from typing import Any, Final, final

import numpy as np
from rich.console import Console

from app.config import Limits, Site
from app.rig.kinova.client.link import Address
from app.rig.kinova.control import connect_arm
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from bench.faults.__main__ import table
from bench.faults.application import FAULTS, Doing
from bench.faults.inject import Motion, Others, Outcome, faults, subject
from bench.faults.place import KEPT_OUT

_TIMES, _LOSS, _LOSSY_S = 3, 0.01, 150.0
SITE: Final = Site(limits=Limits(speed_m_s=0.10, keep_out=(KEPT_OUT,)))
"""The speed that a real cell begins with (docs/real-cell.md)."""
_FAULT_BIT = 1 << 3
_ROUNDED, _BEYOND_M = 1 + 1e-6, 1e-3
"""Numbers of the wire have 24 bits; a tool that is at a wall is where its arm can hold it."""


@final
class Wire:
    """Commands and motion of the emulated arm."""

    def __init__(self, fake: FakeProcess, limits: Limits) -> None:
        self._fake, self._limits = fake, limits

    def motion(self) -> Motion:
        """Recent motion of its tool."""
        states = self._fake.states.since(0)
        times_s, places = states["time_s"], states["tool"][:, :3, 3]
        return times_s[1:], np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times_s)

    def within(self, since_s: float) -> bool:
        """True if every command that it received since then kept to the limits, and so did its tool."""
        told = [each for each in self._fake.commands() if each["time_s"] >= since_s]
        states = self._fake.states.since(0)
        places = states["tool"][states["time_s"] >= since_s, :3, 3]
        box, beyond = self._limits.workspace, np.full(3, _BEYOND_M)
        inside = (places >= box.low - beyond).all() and (places <= box.high + beyond).all()
        return bool(inside) and self._limits.entered_volume(places) is None and all(map(self._allowed, told))

    def _allowed(self, told: dict[str, Any]) -> bool:
        limits, positions = self._limits, np.array(told["positions"], np.float32).reshape(-1, 3)
        slow = told["linear_m_s"] <= limits.speed_m_s * _ROUNDED
        gentle = told["angular_deg_s"] <= np.degrees(limits.angular_speed_rad_s) * _ROUNDED
        free = len(positions) == 0 or limits.entered_volume(positions) is None
        low, high = (np.array(each, np.float32) for each in (limits.workspace.low, limits.workspace.high))
        return bool(slow and gentle and free and (positions >= low).all() and (positions <= high).all())


def wire(fake: FakeProcess) -> Others:
    """Faults between the arm's process and the arm, and in the arm."""
    return {
        "cut": fake.cut,
        "deaf": partial(fake.set, FaultInjection(deaf=True)),
        "feedback lost": partial(fake.set, FaultInjection(lose_feedback=1_000_000)),
        "another commands": partial(fake.take_over, SITE.limits.speed_m_s),
        "joint fault": partial(fake.fail, joint=2, bits=_FAULT_BIT),
        "base fault": partial(fake.fail, base=_FAULT_BIT),
        "pushed hard": partial(fake.set, FaultInjection(force_n=500.0)),
    }


def suffered(doing: Doing, *, alone: bool = False) -> list[Outcome]:
    """Outcomes of all faults in turn; of those at the wire `alone`."""
    with FakeProcess() as fake:
        take = partial(connect_arm, Address(host=fake.host, tcp_port=fake.ports[0], udp_port=fake.ports[1]))
        others, found = wire(fake), list[Outcome]()
        with subject(doing, SITE, take, others, Wire(fake, SITE.limits)) as one:
            for fault in (*(() if alone else faults(doing)), *others):
                found.append(one.suffer(fault))
                fake.set(FaultInjection())
                fake.fail()
        return found


def disturbed(doing: Doing, seconds: float, adversity: FaultInjection) -> list[str]:
    """Reasons for stops of the arm under a disturbance that should cause none."""
    with FakeProcess() as fake:
        take = partial(connect_arm, Address(host=fake.host, tcp_port=fake.ports[0], udp_port=fake.ports[1]))
        with subject(doing, SITE, take) as one:
            one.wait_until_fast()
            fake.set(adversity)
            return one.stops(seconds)


def main(arguments: Sequence[str]) -> None:
    """Print the table; `wire` leaves out what goes wrong in the application; `loss` counts stops without a reason."""
    number = next((int(each) for each in arguments if each.isdigit()), None)
    if "loss" in arguments:
        for doing in FAULTS:
            stops = disturbed(doing, number or _LOSSY_S, FaultInjection(loss=_LOSS))
            Console().print(f"{doing}: {len(stops)} stops in {number or _LOSSY_S:.0f} s, 1 % of all lost. {stops}")
        return
    rounds: list[Doing] = [doing for doing in FAULTS for _ in range(number or _TIMES)]
    Console().print(table([each for doing in rounds for each in suffered(doing, alone="wire" in arguments)]))


if __name__ == "__main__":
    main(sys.argv[1:])
