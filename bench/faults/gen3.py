"""The same faults, and those of a network and an arm, with a Gen3 that is not there: `python -m bench.faults.gen3`."""

import sys
from collections.abc import Sequence
from functools import partial

import numpy as np
from rich.console import Console

from app.config import Limits, Site
from app.rig.kinova.control import taken
from app.rig.kinova.fake.adversity import Adversity
from app.rig.kinova.fake.process import FakeProcess
from app.rig.kinova.link import Address
from bench.faults.__main__ import table
from bench.faults.application import FAULTS, Doing
from bench.faults.inject import Motion, Others, Outcome, faults, subject

_TIMES = 3
_SITE = Site(limits=Limits(speed_m_s=0.10))
"""The speed that a real cell begins with (docs/real-cell.md)."""
_FAULT_BIT = 1 << 3


def wire(fake: FakeProcess) -> Others:
    """What may go wrong between the arm's process and the arm, and in the arm."""
    return {
        "cut": fake.cut,
        "deaf": partial(fake.set, Adversity(deaf=True)),
        "feedback lost": partial(fake.set, Adversity(lose_feedback=1_000_000)),
        "another commands": partial(fake.set, Adversity(foreign=True)),
        "joint fault": partial(fake.fail, joint=2, bits=_FAULT_BIT),
        "base fault": partial(fake.fail, base=_FAULT_BIT),
        "pushed hard": partial(fake.set, Adversity(force_n=500.0)),
    }


def truth(fake: FakeProcess) -> Motion:
    """How its tool moved lately."""
    states = fake.states.since(0)
    times_s, places = states["time_s"], states["tool"][:, :3, 3]
    return times_s[1:], np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times_s)


def suffered(doing: Doing, site: Site) -> tuple[list[Outcome], list[dict[str, object]]]:
    """What came of every fault in turn, and all that the arm was told over the wire."""
    with FakeProcess() as fake:
        take = partial(taken, Address(host=fake.host, tcp_port=fake.ports[0], udp_port=fake.ports[1]))
        others, found = wire(fake), list[Outcome]()
        with subject(doing, site, take, others, partial(truth, fake)) as one:
            for fault in (*faults(doing), *others):
                found.append(one.suffer(fault))
                fake.set(Adversity())
                fake.fail()
        return found, fake.commands()


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    times, outcomes, fastest = int(arguments[0]) if arguments else _TIMES, list[Outcome](), 0.0
    for doing in FAULTS:
        for _ in range(times):
            found, told = suffered(doing, _SITE)
            outcomes += found
            fastest = max([fastest, *(float(str(each["linear_m_s"])) for each in told)])
    Console().print(table(outcomes))
    Console().print(f"Fastest that the arm was told to move: {fastest:.3f} of {_SITE.limits.speed_m_s} m/s.")


if __name__ == "__main__":
    main(sys.argv[1:])
