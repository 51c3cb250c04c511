"""The painter keeps up without being waited for, and survives what it cannot paint."""

import threading

from app.ui.parts.console_state import Board
from app.ui.parts.operator_controller import Desk
from app.ui.view.render_loop import Painter
from tests.ui import synthetic


def desk() -> Desk:
    return Desk(stop=lambda: None, post=lambda request: None)


def test_a_slow_painter_delays_nobody_and_paints_the_newest():
    table, allowed, painted = desk(), threading.Event(), list[Board]()
    newest = threading.Event()

    def paint(board: Board, _: float) -> None:
        allowed.wait(10)
        painted.append(board)
        if board.particles is last:
            newest.set()

    last = synthetic.particles(synthetic.rope(0.1))
    painter = Painter(table, paint)
    painter.start()
    for _ in range(1000):
        table.show(synthetic.arm())
    table.show(last)
    allowed.set()
    assert newest.wait(10)
    painter.close()
    assert len(painted) < 20


def test_a_stroke_that_fails_is_reported_once_and_the_next_ones_are_made(caplog):
    table, strokes = desk(), threading.Semaphore(0)

    def paint(board: Board, _: float) -> None:
        strokes.release()
        raise ValueError("no such colour")

    painter = Painter(table, paint)
    painter.start()
    for _ in range(3):
        assert strokes.acquire(timeout=10)
        table.show(synthetic.arm())
    painter.close()
    assert [fault.text for fault in table.board.log] == ["ValueError: no such colour"]
    assert len(caplog.records) == 1


def test_a_painter_that_never_began_can_be_closed():
    Painter(desk(), lambda board, now_s: None).close()
