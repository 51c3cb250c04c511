"""Shared records: complete, in order, and never waited for."""

import numpy as np

from app.core.system.ring import Ring, Stamp

RECORD = np.dtype([("number", "i8"), ("values", "f8", (3,))])


def filled(count: int) -> Ring:
    ring = Ring(RECORD, 4)
    for number in range(count):
        ring.append(number=number, values=[number, number, number])
    return ring


def test_an_empty_ring_has_no_newest_record() -> None:
    assert filled(0).newest() is None
    assert len(filled(0).since(0)) == 0


def test_the_newest_record_is_the_last_appended() -> None:
    assert [int(filled(count).newest()["number"]) for count in (1, 4, 9)] == [0, 3, 8]


def test_records_since_a_count_are_those_after_it_in_order() -> None:
    assert filled(4).since(2)["number"].tolist() == [2, 3]
    assert filled(4).since(4)["number"].tolist() == []


def test_overwritten_records_are_left_out_and_the_one_being_written_next_too() -> None:
    assert filled(9).since(0)["number"].tolist() == [6, 7, 8]


def test_what_was_read_does_not_change_when_more_is_written() -> None:
    ring = filled(1)
    newest, all_of_it = ring.newest(), ring.since(0)
    for _ in range(8):
        ring.append(number=99, values=[9, 9, 9])
    assert newest["number"] == 0
    assert all_of_it["number"].tolist() == [0]


def test_a_stamp_holds_what_was_set_last() -> None:
    stamp = Stamp()
    assert stamp.value == 0
    stamp.value = 2**62
    assert stamp.value == 2**62
