"""Channels: what overwrites counts its losses, what is lossless loses nothing."""

import random
from collections.abc import Awaitable, Callable
from functools import partial

import anyio
import pytest
from anyio.lowlevel import checkpoint

from app.core.system.channel import ChannelFull, Latest, Lossless

pytestmark = pytest.mark.anyio


async def test_latest_gives_the_newest_value_and_counts_the_unread_ones():
    channel = Latest[int]("particles")
    assert channel.value is None
    for value in range(5):
        channel.put(value)
    assert channel.value == 4
    assert channel.dropped == 4
    assert await anext(channel.changes()) == 4


async def test_latest_drops_nothing_for_a_reader_that_keeps_up():
    channel = Latest[int]("frames")
    seen: list[int] = []

    async def read():
        async for value in channel.changes():
            seen.append(value)
            if value == 9:
                return

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(read)
        for value in range(10):
            channel.put(value)
            while len(seen) <= value:
                await checkpoint()
    assert seen == list(range(10))
    assert channel.dropped == 0


async def test_every_reader_of_latest_sees_values_in_order_and_the_last_one():
    channel = Latest[int]("plans")
    seen: dict[int, list[int]] = {1: [], 3: [], 7: []}

    async def read(slowness: int):
        async for value in channel.changes():
            seen[slowness].append(value)
            if value == 49:
                return
            for _ in range(slowness):
                await checkpoint()

    async with anyio.create_task_group() as tasks:
        for slowness in seen:
            tasks.start_soon(read, slowness)
        for value in range(50):
            channel.put(value)
            await checkpoint()
    for values in seen.values():
        assert values == sorted(set(values))
        assert values[-1] == 49
    assert len(seen[7]) < len(seen[1])


async def test_a_late_reader_of_latest_starts_with_the_current_value():
    channel = Latest[str]("model")
    channel.put("version 0")
    channel.put("version 1")
    reader = channel.changes()
    assert await anext(reader) == "version 1"
    with anyio.move_on_after(0.01) as waiting:
        await anext(reader)
    assert waiting.cancelled_caught


async def test_lossless_delivers_everything_in_order_from_concurrent_senders():
    channel = Lossless[tuple[int, int]]("log", bound=3)

    async def send(sender: int):
        for index in range(40):
            await channel.put((sender, index))

    async with anyio.create_task_group() as tasks:
        for sender in range(4):
            tasks.start_soon(send, sender)
        received = [await channel.get() for _ in range(160)]
    assert len(set(received)) == 160
    for sender in range(4):
        assert [index for who, index in received if who == sender] == list(range(40))
    assert 1 <= channel.peak <= 3


async def test_a_sender_waits_while_a_lossless_channel_is_full():
    channel = Lossless[int]("log", bound=1)
    await channel.put(0)
    with anyio.move_on_after(0.01) as waiting:
        await channel.put(1)
    assert waiting.cancelled_caught
    assert await channel.get() == 0
    assert channel.get_nowait() is None


async def test_what_cannot_wait_is_told_that_a_lossless_channel_is_full():
    channel = Lossless[int]("requests", bound=2)
    channel.put_nowait(0)
    channel.put_nowait(1)
    with pytest.raises(ChannelFull, match="'requests' is full at 2"):
        channel.put_nowait(2)
    assert [channel.get_nowait(), channel.get_nowait(), channel.get_nowait()] == [0, 1, None]
    assert channel.peak == 2


async def test_readers_of_a_closed_lossless_channel_end_after_the_last_value():
    channel = Lossless[int]("log", bound=8)
    for value in range(5):
        await channel.put(value)
    channel.close()
    assert [value async for value in channel] == [0, 1, 2, 3, 4]


async def test_a_closed_lossless_channel_takes_no_more():
    channel = Lossless[int]("log", bound=8)
    channel.close()
    with pytest.raises(anyio.ClosedResourceError):
        await channel.put(0)
    with pytest.raises(anyio.EndOfStream):
        await channel.get()


async def test_cancelled_senders_and_readers_lose_and_repeat_nothing():
    channel = Lossless[int]("log", bound=2)
    rng = random.Random(0)
    sent: list[int] = []
    received: list[int] = []

    async def send(value: int):
        await channel.put(value)
        sent.append(value)

    async def read():
        received.append(await channel.get())

    async with anyio.create_task_group() as tasks:
        for value in range(300):
            scope = anyio.CancelScope()
            tasks.start_soon(_within, scope, partial(send, value) if rng.random() < 0.5 else read)
            for _ in range(rng.randrange(3)):
                await checkpoint()
            if rng.random() < 0.3:
                scope.cancel()
            if rng.random() < 0.2:
                received.extend(iter(channel.get_nowait, None))
        tasks.cancel_scope.cancel()
    received.extend(iter(channel.get_nowait, None))
    assert sorted(received) == sorted(sent)
    assert len(sent) > 50


async def _within(scope: anyio.CancelScope, action: Callable[[], Awaitable[None]]):
    with scope:
        await action()
