"""The painter keeps up without being waited for, and survives what it cannot paint."""

import threading

from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController
from app.ui.view.render_loop import RenderLoop
from tests.ui import synthetic


def controller() -> OperatorController:
    return OperatorController(stop=lambda: None, post=lambda request: None)


def test_a_slow_painter_delays_nobody_and_paints_the_newest():
    table, allowed, painted = controller(), threading.Event(), list[ConsoleState]()
    newest = threading.Event()

    def paint(state: ConsoleState, _: float) -> None:
        allowed.wait(10)
        painted.append(state)
        if state.particles is last:
            newest.set()

    last = synthetic.particles(synthetic.rope(0.1))
    painter = RenderLoop(table, paint)
    painter.start()
    for _ in range(1000):
        table.show(synthetic.arm())
    table.show(last)
    allowed.set()
    assert newest.wait(10)
    painter.close()
    assert len(painted) < 20


def test_a_stroke_that_fails_is_reported_once_and_the_next_ones_are_made(caplog):
    table, strokes = controller(), threading.Semaphore(0)

    def paint(state: ConsoleState, _: float) -> None:
        strokes.release()
        raise ValueError("no such colour")

    painter = RenderLoop(table, paint)
    painter.start()
    for _ in range(3):
        assert strokes.acquire(timeout=10)
        table.show(synthetic.arm())
    painter.close()
    assert [fault.text for fault in table.state.log] == ["ValueError: no such colour"]
    assert len(caplog.records) == 1


def test_a_painter_that_never_began_can_be_closed():
    RenderLoop(controller(), lambda state, now_s: None).close()
