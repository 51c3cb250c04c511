"""Fixtures for all tests of the folder: an emulated arm, and clients that speak with it."""

import contextlib
import importlib.util
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from app.rig.kinova.api.errors import LinkLost, NoAnswer
from app.rig.kinova.api.messages import CartesianWaypoint, Pose
from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.client.link import Address, Link
from app.rig.kinova.client.official import OfficialLink
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.kortex import Kortex

NO_WHEEL = "kortex_api, Kinova's own client, is not on any index; docs/kinova.md says where its wheel is"
INSTALLED = importlib.util.find_spec("kortex_api") is not None
CLIENTS = [OwnLink, pytest.param(OfficialLink, marks=pytest.mark.skipif(not INSTALLED, reason=NO_WHEEL))]


PATIENT_S = 2.0
"""Time [s] of silence after which an arm stops, where that is not tested: threads may be late on a busy machine."""


@pytest.fixture(scope="package")
def process() -> Iterator[FakeProcess]:
    # Kinova's client takes no other port.
    with FakeProcess(udp_port=10001 if INSTALLED else 0) as process:
        yield process


@pytest.fixture
def arm(process: FakeProcess) -> FakeProcess:
    """The emulated arm in its first state, ready, and with nobody connected."""
    process.reset()
    return process


def address(arm: FakeProcess, **changed: object) -> Address:
    return Address(**{"host": arm.host, "tcp_port": arm.ports[0], "udp_port": arm.ports[1], **changed})  # type: ignore[arg-type]


@pytest.fixture(params=CLIENTS, ids=lambda client: client.__name__)
def link(request: pytest.FixtureRequest, arm: FakeProcess) -> Iterator[Link]:
    link = request.param(address(arm, stops_after_s=PATIENT_S))
    yield link
    arm.set(FaultInjection())
    link.close()


@pytest.fixture
def kortex(link: Link) -> Iterator[Kortex]:
    """Client that is connected, and kept alive as the driver's thread does."""
    kortex, over = Kortex(link), threading.Event()
    kortex.open()
    alive = threading.Thread(target=keep_alive, args=(kortex, over))
    alive.start()
    yield kortex
    over.set()
    alive.join()


def keep_alive(kortex: Kortex, over: threading.Event) -> None:
    while not over.wait(0.025) and not kortex.loss_reason:
        with contextlib.suppress(LinkLost):
            kortex.keep_alive()


def until(holds: Callable[[], object], seconds: float = 30.0) -> None:
    """Wait until something holds; the limit is for a machine that is busy with other things."""
    end = time.monotonic() + seconds
    while True:
        # Feedback that comes too late is asked for again, as the driver does.
        with contextlib.suppress(NoAnswer):
            if holds():
                return
        assert time.monotonic() < end, "it never came to hold"
        time.sleep(0.01)


def way(
    x: float, y: float, z: float, *, speed: float = 0.3, radius: float = 0.0, turn: float = 0.0
) -> CartesianWaypoint:
    """A waypoint [m] of a tool that points down."""
    return CartesianWaypoint(
        pose=Pose(x=x, y=y, z=z, theta_x=180.0, theta_y=0.0, theta_z=turn),
        reference_frame=3,
        maximum_linear_velocity=speed,
        maximum_angular_velocity=60.0,
        blending_radius=radius,
    )


def tool(arm: FakeProcess) -> np.ndarray:
    """True place of the emulated arm's tool [m]."""
    return np.array(arm.look()["tool"])
