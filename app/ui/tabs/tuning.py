"""The segmentation colours: sliders whose effect is previewed in the pictures before they are used."""

from collections.abc import Sequence
from typing import Any, Final, final

import viser

from app.core.colours import ColourRange
from app.core.errors import ParameterError
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.text import Text

_WHOLE_CIRCLE: Final = 360.0
_FIRST: Final = ColourRange(hue_low_deg=0.0, hue_high_deg=_WHOLE_CIRCLE)
"""Colours before any segmentation."""
_NEUTRAL: Final = (128, 128, 128)


@final
class Tuning:
    """A form in the container that is open when this is made. Until it is submitted nothing but the preview changes."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._controller, self._state = controller, ConsoleState()
        self._form = gui.add_form("Colours of the object", expand_by_default=False)
        with self._form:
            self._near = gui.add_rgb(
                "Near",
                _NEUTRAL,
                hint="Sets the sliders around a colour; the pipette picks one",
            )
            self._hue = gui.add_multi_slider("Hue", 0.0, _WHOLE_CIRCLE, 1.0, _FIRST.hue_deg)
            self._red = gui.add_checkbox(
                "Through red", initial_value=False, hint="From the upper handle through red to the lower one"
            )
            self._saturation = gui.add_multi_slider("Saturation", 0.0, 1.0, 0.01, _FIRST.saturation)
            self._value = gui.add_multi_slider("Value", 0.0, 1.0, 0.01, _FIRST.value)
            self._status = Text(gui, _state(None, None))
            self._use = gui.add_button("Use these colours", icon=viser.Icon.CHECK, disabled=True)
            self._undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, disabled=True)
        self._near.on_update(lambda event: self._set(_around(event.target.value)))
        self._use.on_click(self._on_submit)
        self._form.on_submit(self._on_submit)
        self._undo.on_click(self._undone)

    def paint(self, state: ConsoleState) -> ColourRange | None:
        """Follow the colours in use; returns the sliders' colours where they differ: to be previewed."""
        last, self._state = self._state, state
        if state.colours and state.colours is not last.colours:
            self._set(state.colours[-1])
        wanted = self.colour_range if state.colours else None
        used = state.colours[-1] if state.colours else None
        changed = wanted is not None and used is not None and wanted != _round_to_steps(used)
        self._status.put(_state(used, wanted if changed else None))
        for button, disabled in ((self._use, not changed), (self._undo, len(state.colours) < 2)):
            if button.disabled != disabled:
                button.disabled = disabled
        return wanted if changed else None

    @property
    def colour_range(self) -> ColourRange | None:
        """Colours of the sliders; None where they form no range: a browser may have sent anything."""
        try:
            hue, saturation, value = (_ends(each.value) for each in (self._hue, self._saturation, self._value))
            return ColourRange.of((hue[1], hue[0]) if self._red.value else hue, saturation, value)
        except (ParameterError, ValueError):
            return None

    def _set(self, colour: ColourRange) -> None:
        near, low, high = _round_to_steps(colour), *colour.hue_deg
        self._red.value = low > high
        low, high = near.hue_deg
        self._hue.value = (min(low, high), max(low, high))
        self._saturation.value, self._value.value = near.saturation, near.value

    def _on_submit(self, event: viser.GuiEvent[Any]) -> None:
        wanted = self.colour_range
        if wanted is not None:
            self._controller.use_colours(wanted, operator=operator(event))

    def _undone(self, event: viser.GuiEvent[Any]) -> None:
        former = self._state.colours[-2:-1]
        if former:
            self._controller.use_colours(former[0], operator=operator(event))


def _around(rgb: Sequence[int]) -> ColourRange:
    red, green, blue = (min(max(each / 255, 0.0), 1.0) for each in rgb)
    return ColourRange.around((red, green, blue))


def _ends(values: Sequence[float]) -> tuple[float, float]:
    """Low and high end of a slider. Raises ValueError where a browser sent another count than two."""
    low, high = sorted(values)
    return low, high


def _round_to_steps(colour: ColourRange) -> ColourRange:
    """The colours rounded to the sliders' steps."""
    hue = round(colour.hue_low_deg), round(colour.hue_high_deg)
    saturation = round(colour.saturation_low, 2), round(colour.saturation_high, 2)
    value = round(colour.value_low, 2), round(colour.value_high, 2)
    return ColourRange.of((float(hue[0]), float(hue[1])), saturation, value)


def _state(used: ColourRange | None, wanted: ColourRange | None) -> str:
    if used is None:
        said = "No camera has looked for the object yet."
    elif wanted is None:
        said = f"In use: {_spelt(used)}."
    else:
        said = f"Preview of {_spelt(wanted)}. Nothing has changed yet; in use: {_spelt(used)}."
    return f'<div class="dp"><small>{said}</small></div>'


def _spelt(colour: ColourRange) -> str:
    hue, saturation, value = colour.hue_deg, colour.saturation, colour.value
    return (
        f"hue {hue[0]:.0f}\N{EN DASH}{hue[1]:.0f}°, saturation {saturation[0]:.2f}\N{EN DASH}{saturation[1]:.2f}, "
        f"value {value[0]:.2f}\N{EN DASH}{value[1]:.2f}"
    )
