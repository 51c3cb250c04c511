"""While the garbage collector is spared, it skips all objects made before, and none made since."""

import gc
import weakref
from collections.abc import Iterator

import pytest

from app.core.system import gc_control
from app.core.system.gc_control import paused_collection, spared_collection


class Knot:
    """Object that refers to itself: freed by the collector alone."""

    def __init__(self) -> None:
        self.itself = self


def collected(knot: Knot) -> bool:
    """True if the collector examines `knot`."""
    return any(each is knot for each in gc.get_objects())


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Collector state of a process in which nothing is spared yet, unlike the one that runs the tests."""
    monkeypatch.setattr(gc_control, "_open", list[None]())
    gc.unfreeze()
    yield
    gc.freeze()


def test_what_was_made_before_is_passed_over_for_as_long_as_it_is_open() -> None:
    before = Knot()
    assert collected(before)
    with spared_collection():
        assert not collected(before)
    assert collected(before)


def test_of_blocks_in_one_another_the_outermost_ends_it() -> None:
    before = Knot()
    with spared_collection():
        with spared_collection():
            pass
        assert not collected(before)
    assert collected(before)


def test_what_is_made_meanwhile_is_freed_as_ever() -> None:
    with spared_collection():
        freed = weakref.ref(Knot())
        assert freed() is not None
        gc.collect()
        assert freed() is None


def test_garbage_of_before_is_freed_first() -> None:
    freed = weakref.ref(Knot())
    with spared_collection():
        assert freed() is None


def test_a_pause_ends_with_the_block_and_leaves_alone_what_did_not_collect() -> None:
    with paused_collection():
        assert not gc.isenabled()
        with paused_collection():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()
