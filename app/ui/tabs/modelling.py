"""The tab of the model: its estimates, its prediction of the last motion, and the version to plan with."""

from collections.abc import Iterable
from html import escape
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import viser
from viser import uplot

from app.core.dialogue import words
from app.core.errors import DipacError
from app.core.messages import Model
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.plots import HEIGHT_PX, PADDING_PX, line
from app.ui.parts.text import Text
from app.ui.tabs import models
from app.ui.tabs.model_files import read_model

_NONE: Final = "none"
_NUMBERS_PX: Final = 64.0
"""Width for the axis numbers, such as a stiffness in pascals."""
_FILE: Final = "discovery/model.toml"


@final
class ModelTab:
    """Drawn into the container that is open when this is made. `folder`: root of the model files that may be named."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController, folder: Path) -> None:
        self._gui, self._last = gui, ConsoleState()
        self._summary = Text(gui, models.summary(self._last))
        with gui.add_folder("Parameters"):
            self._parameters = Text(gui, "")
        with gui.add_folder("The last motion, predicted and seen"):
            self._motion = Text(gui, models.last_motion(self._last))
        self._versions = Versions(gui, controller, folder)
        self._course = Course(gui)

    def paint(self, state: ConsoleState) -> None:
        """Update the tab to the state."""
        last, self._last = self._last, state
        self._summary.put(models.summary(state))
        if state.models is not last.models:
            self._parameters.put(models.parameters(state, rows=models.notable_parameters(state.models)))
        if (state.made, state.watched, state.outcomes) != (last.made, last.watched, last.outcomes):
            self._motion.put(models.last_motion(state))
        self._versions.paint(state)
        self._course.paint(state)


@final
class Versions:
    """The models of this session to compare and go back to, and files to load others from."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController, folder: Path) -> None:
        self._controller, self._folder = controller, folder
        self._shown: tuple[Model, ...] = ()
        with gui.add_folder("Versions"):
            self._chosen = gui.add_dropdown("Version", _or_none(()))
            self._other = gui.add_dropdown("Compare with", _or_none(()))
            self._difference = Text(gui, "")
            self._use = gui.add_button("Use this version", icon=viser.Icon.HISTORY, disabled=True)
        self._form = gui.add_form("A model from a file")
        with self._form:
            self._file = gui.add_text(
                "File", _FILE, hint="On the program's machine, within the folder it was started in"
            )
            self._load = gui.add_button("Load", icon=viser.Icon.FILE_UPLOAD)
            self._answer = Text(gui, "")
        self._use.on_click(self._go_back)
        self._load.on_click(self._on_load)
        self._form.on_submit(self._on_load)

    def paint(self, state: ConsoleState) -> None:
        """Offer the available versions."""
        if state.models is not self._shown:
            following = self._model(self._chosen.value) in (None, *self._shown[-1:])
            self._shown = state.models
            labels = tuple(map(label, reversed(state.models)))
            self._chosen.options, self._other.options = labels or _or_none(()), _or_none(labels)
            if following:  # The newest is still chosen.
                self._chosen.value = self._chosen.options[0]
        chosen, other = self._model(self._chosen.value), self._model(self._other.value)
        self._difference.put(models.compare(chosen, other) if chosen and other else "")
        disabled = chosen is None or state.model is None or chosen.version == state.model.version
        if self._use.disabled != disabled:
            self._use.disabled = disabled

    def _model(self, said: str) -> Model | None:
        return next((model for model in self._shown if label(model) == said), None)

    def _go_back(self, event: viser.GuiEvent[Any]) -> None:
        model = self._model(self._chosen.value)
        if model is not None:
            self._controller.use_model(model, f"version {model.version}", operator=operator(event))

    def _on_load(self, event: viser.GuiEvent[Any]) -> None:
        """Read the file in this thread of viser's, which blocks nothing else."""
        episode, named = self._controller.state.episode, self._file.value
        if episode is None:
            self._answer.put(_answer("The program has not begun yet; try again in a moment.", "dp-warn"))
            return
        try:
            model = read_model(named, self._folder, task=episode.task, time_s=self._controller.now())
        except DipacError as error:
            self._answer.put(_answer(str(error), "dp-bad"))
            return
        self._controller.use_model(model, named, operator=operator(event))
        self._answer.put(_answer(f"{named} was read; the messages say whether it is used.", ""))


@final
class Course:
    """Plots over the versions: the one-step error, and one parameter with its 90 % interval."""

    def __init__(self, gui: viser.GuiApi) -> None:
        flat, version = np.zeros(2), uplot.Series(label="version")
        scales = {"x": uplot.Scale(time=False)}
        self._loss = gui.add_uplot(
            (flat, flat),
            (version, line("error [mm]", palette.BEST)),
            title="One-step error of the model",
            height=HEIGHT_PX,
            padding=PADDING_PX,
            scales=scales,
            visible=False,
        )
        self._name = gui.add_dropdown("Parameter", _or_none(()), visible=False)
        self._value = gui.add_uplot(
            (flat, flat, flat, flat),
            (
                version,
                line("value", palette.BEST),
                line("5 %", palette.OUTLINE),
                line("95 %", palette.OUTLINE),
            ),
            title="Its value and 90 % interval",
            axes=(uplot.Axis(), uplot.Axis(size=_NUMBERS_PX)),
            height=HEIGHT_PX,
            padding=PADDING_PX,
            scales=scales,
            visible=False,
        )
        self._drawn: tuple[tuple[Model, ...], str] = ((), "")
        self._last = ConsoleState()

    def paint(self, state: ConsoleState) -> None:
        """Redraw plots with new data, or of another chosen parameter."""
        last, self._last = self._last, state
        if state.losses is not last.losses:
            if state.losses:
                versions, losses = zip(*state.losses, strict=True)
                self._loss.data = (np.array(versions, float), np.array([words.millimetres(loss) for loss in losses]))
            self._loss.visible = bool(state.losses)
        if state.models is not last.models and (names := models.notable_parameters(state.models)):
            self._name.options = tuple(map(models.spelt, names))
            self._name.visible = self._value.visible = True
        if state.models and (state.models, self._name.value) != self._drawn:
            self._drawn = state.models, self._name.value
            named = {models.spelt(name): name for name in models.notable_parameters(state.models)}
            if self._name.value in named:
                self._value.data = course(state.models, named[self._name.value])


def course(versions: tuple[Model, ...], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Version number, value, low and high end of the interval of the parameter `name`, each (n,)."""
    known = [(model.version, found) for model in versions if (found := models.parameter(model, name))]
    rows = [(float(version), each.value, each.low, each.high) for version, each in sorted(known, key=itemgetter(0))]
    number, value, low, high = np.array(rows, float).reshape(-1, 4).T
    return number, value, low, high


def label(model: Model) -> str:
    """Name of a version in a list."""
    return f"version {model.version}, {words.distance(model.loss_m2)}"


def _answer(text: str, tone: str) -> str:
    return f'<div class="dp"><small class="{tone}" role="alert">{escape(text)}</small></div>'


def _or_none(names: Iterable[str]) -> tuple[str, ...]:
    return (_NONE, *names)
