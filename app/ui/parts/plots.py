"""Plot of the object's distance from its goal, push by push."""

from typing import final

import numpy as np
import viser
from viser import uplot

from app.core.dialogue.words import millimetres
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState

HEIGHT_PX = 180
PADDING_PX = (12, 24, 0, 0)


@final
class Plots:
    """Drawn into the container that is open when this is made; empty until there is something to draw."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._empty = gui.add_html('<div class="dp"><small>After the first motion.</small></div>')
        flat = np.zeros(2)
        self._distance = gui.add_uplot(
            (flat, flat, flat),
            (
                uplot.Series(label="motion"),
                line("seen [mm]", palette.OBSERVED),
                line("predicted [mm]", palette.PREDICTED),
            ),
            title="Distance to the goal",
            height=HEIGHT_PX,
            padding=PADDING_PX,
            scales={"x": uplot.Scale(time=False)},
            visible=False,
        )
        self._last = ConsoleState()

    def paint(self, state: ConsoleState) -> None:
        """Redraw plots with new data."""
        last, self._last = self._last, state
        if state.outcomes is not last.outcomes:
            if state.outcomes:
                self._distance.data = distances(state)
            self._distance.visible = bool(state.outcomes)
            self._empty.visible = not state.outcomes


def distances(state: ConsoleState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Push number, observed and predicted distance [mm], each (n + 1,), the start before the first push."""
    start = state.outcomes[0].chamfer_before_m2
    seen = [start, *(outcome.chamfer_after_m2 for outcome in state.outcomes)]
    predicted = [start, *(outcome.predicted_chamfer_m2 for outcome in state.outcomes)]
    return (
        np.arange(len(seen), dtype=float),
        np.array([millimetres(value) for value in seen]),
        np.array([millimetres(value) for value in predicted]),
    )


def line(label: str, colour: palette.Colour) -> uplot.Series:
    """Style of a plotted line."""
    return uplot.Series(label=label, stroke=f"rgb{colour}", width=2)
