"""The store of a session's state: what waits is woken, what may not go on is cancelled, and only then it is told."""

import anyio
import pytest

from app.core.announcer import MessageBus
from app.core.dialogue.summary import Summary
from app.core.errors import DeviceError
from app.core.messages import Message, Notice
from app.core.system.clock import SystemClock
from app.session.state import Interruption, SessionState
from app.session.store import SessionStore
from tests.session.test_rules import chosen, state, stop

pytestmark = pytest.mark.anyio


class Screen:
    """Operator who sees all messages, but for notices where the screen is `broken`."""

    def __init__(self, *, broken: bool = False) -> None:
        self.broken, self.shown = broken, list[Message]()

    def show(self, message: Message) -> None:
        if self.broken and isinstance(message, Notice):
            raise DeviceError("The screen is broken.")
        self.shown.append(message)


def store_of(begin: SessionState, screen: Screen | None = None) -> SessionStore:
    clock = SystemClock()
    bus = MessageBus(operator=screen or Screen(), recorder=None, clock=clock, summary=Summary())
    return SessionStore(begin, bus, clock)


async def test_a_stop_cancels_what_is_under_way_even_if_it_cannot_be_told():
    store = store_of(state(), Screen(broken=True))
    with store.until_interrupted() as scope:
        with pytest.raises(DeviceError):
            store.dispatch(stop())
        assert scope.cancel_called
    assert store.state.stopped


async def test_who_waits_for_a_state_is_woken_by_the_event_that_brings_it():
    store = store_of(state())
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(store.until, lambda now: now.stopped)
        await anyio.lowlevel.checkpoint()
        store.dispatch(Interruption("was made for another goal"))  # Wakes it, and is not what it waits for.
        await anyio.lowlevel.checkpoint()
        store.dispatch(stop())
    assert store.state.stopped  # And the task has ended.


async def test_a_wait_that_grows_old_is_told_from_one_that_is_interrupted():
    store = store_of(state())
    with store.until_interrupted(at_most_s=5.0) as old:
        await anyio.sleep_forever()
    assert old.cancelled_caught
    assert store.state.interruptions == 0
    with store.until_interrupted(at_most_s=5.0) as interrupted:
        store.dispatch(Interruption("was made for another goal"))
        await anyio.sleep_forever()
    assert interrupted.cancelled_caught
    assert store.state.interruptions == 1


async def test_a_mode_that_is_left_and_chosen_again_has_ended():
    store = store_of(state())
    ended = store.mode_over
    with store.in_this_mode() as scope:
        store.dispatch(chosen("idle"))
        store.dispatch(chosen("approve each"))
        assert scope.cancel_called
    assert ended.is_set()
    assert not store.mode_over.is_set()


async def test_what_is_over_is_not_cancelled_any_more():
    store = store_of(state())
    with store.until_interrupted() as scope:
        pass
    store.dispatch(stop())
    assert not scope.cancel_called
