"""The tab that describes the object: measured in the live view, corrected by hand, saved as a file."""

from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any, Final, NamedTuple, final

import viser

from app.core.dialogue.object_messages import MeasuredObject
from app.core.dialogue.requests import MeasureRequest
from app.core.errors import DipacError, ParameterError, UsageError
from app.core.geometry.object_description import SIZES_OF, ObjectDescription, ObjectType
from app.core.messages import Model, Parameter, fresh_id
from app.recording.exchange.object_file import save_object
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.text import Text
from app.ui.view.measured import card

MEASURE: Final = "Measure the object"
SAVE: Final = "Save the object"
_NAME: Final = "object.toml"
_GREY: Final = (128, 128, 128)
_STEPS: Final = 5000
_LEARNED: Final = frozenset({"stiffness", "table_friction", "finger_friction"})


@final
class _Unit(NamedTuple):
    """Unit in which a size is shown, and the number of them in one of SI."""

    label: str
    scale: float


_UNITS: Final = {
    "length_m": _Unit("Length [mm]", 1e3),
    "radius_m": _Unit("Radius [mm]", 1e3),
    "mass_kg": _Unit("Mass [g]", 1e3),
    "count": _Unit("Number of pieces", 1.0),
    "size_m": _Unit("Side [mm]", 1e3),
    "volume_m3": _Unit("Volume [ml]", 1e6),
    "density_kg_m3": _Unit("Density [kg/m\N{SUPERSCRIPT THREE}]", 1.0),
}
"""Sizes of the object, not of the tool, as people give them."""


@final
class ObjectTab:
    """Drawn into the container that is open when this is made; files are written into `folder`."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController, folder: Path) -> None:
        self._gui, self._controller, self._folder = gui, controller, folder
        self._state = controller.state
        measure = gui.add_button(MEASURE, color="gray", icon=viser.Icon.RULER_MEASURE)
        measure.on_click(self._measure)
        self._said = Text(gui, card(None))
        self._place = gui.add_folder(None)
        self._kind: ObjectType | None = None
        self._fields = dict[str, viser.GuiInputHandle[float]]()
        self._name = gui.add_text("Name", "", hint="What you call it", visible=False)
        self._colour = gui.add_rgb("Colour", _GREY, visible=False)
        self._seen = gui.add_checkbox(
            "Find it by the colours that were seen",
            initial_value=True,
            visible=False,
            hint="Otherwise by the one above",
        )
        self._learned = gui.add_checkbox(
            "With what the model learned",
            initial_value=False,
            visible=False,
            hint="Stiffness and friction of the model in use, with their intervals, as what is known beforehand",
        )
        self._file = gui.add_text("File", _NAME, visible=False, hint="In the folder in which the program was started")
        self._save = gui.add_button(SAVE, icon=viser.Icon.DEVICE_FLOPPY, visible=False)
        self._save.on_click(self._on_save)
        self._saved = Text(gui, "")
        self._shown: MeasuredObject | None = None

    def paint(self, state: ConsoleState) -> None:
        """Follow the newest measurement: it fills the fields, which may be corrected until the next one."""
        self._state = state
        found = state.measured
        if found is None or found is self._shown:
            return
        self._shown = found
        self._said.put(card(found) + _warning(found))
        self._saved.put("")
        if found.kind != self._kind:
            self._build_fields(found.kind)
        for size in found.sizes:
            if size.name in self._fields:
                self._fields[size.name].value = _in_field(size.name, size.value)
        if len(found.colour) == len(_GREY):
            red, green, blue = (round(255 * each) for each in found.colour)
            self._colour.value = (red, green, blue)
        self._seen.visible = found.colours is not None

    def _build_fields(self, kind: ObjectType) -> None:
        for field in self._fields.values():
            field.remove()
        self._fields.clear()
        self._kind = kind
        with self._place:
            for name, (low, high) in SIZES_OF[kind].items():
                if name not in _UNITS:
                    continue
                unit = _UNITS[name]
                step = 1.0 if name == "count" else _step(unit.scale * (high - low) / _STEPS)
                # A bound of the field would change what was measured without a word.
                self._fields[name] = self._gui.add_number(
                    unit.label, unit.scale * low, step=step, hint=_range_text(kind, name)
                )
        for shown in (self._name, self._colour, self._learned, self._file, self._save):
            shown.visible = True

    def _measure(self, event: viser.GuiEvent[Any]) -> None:
        now_s = self._controller.now()
        self._controller.ask(MeasureRequest(id=fresh_id("measure"), time_s=now_s, operator=operator(event)))

    def _on_save(self, event: viser.GuiEvent[Any]) -> None:
        who = operator(event)
        if not self._state.open_to(who):
            self._controller.tell(f"{who} has no control; take it first.")
            return
        try:
            path = self._save_to(str(self._file.value))
        except DipacError as error:
            self._saved.put(f"<div class='dp'><small class='dp-bad'>Not saved. {escape(str(error))}</small></div>")
        else:
            used = f"--object {escape(path.name)}"
            self._saved.put(
                f"<div class='dp'><small>Saved. Begin a session with <b>{used}</b> to use it.</small></div>"
            )

    def _save_to(self, named: str) -> Path:
        """Write the file of that name, and return it. Raises UsageError where it cannot be written or simulated."""
        path, description = _path(self._folder, named), self._description()
        _require_simulable(description)
        save_object(path, description)
        return path

    def _description(self) -> ObjectDescription:
        red, green, blue = (round(each / 255, 3) for each in self._colour.value)
        found = self._shown
        colours = found.colours if found is not None and self._seen.value else None
        return ObjectDescription(
            kind=self._kind,
            name=str(self._name.value).strip(),
            sizes={name: _in_si(name, field.value) for name, field in self._fields.items()},
            colour=(red, green, blue),
            colours=colours,
            priors=_learned(self._state.model) if self._learned.value else (),
        )


def _learned(model: Model | None) -> tuple[Parameter, ...]:
    """Parameters of the model that were estimated, with their intervals."""
    known = () if model is None else model.parameters
    return tuple(
        each for each in known if each.name in _LEARNED and each.low < each.high and each.low <= each.value <= each.high
    )


def _path(folder: Path, named: str) -> Path:
    """The file of that name in the folder. Raises UsageError for any other: any user of the page may name files."""
    name = named.strip()
    path = folder / name
    if not name.endswith(".toml") or not name.isprintable() or Path(name).name != name or not _may_be_file(path):
        raise UsageError(f"{named!r} is no name for it; give a plain one such as {_NAME}.")
    return path


def _may_be_file(path: Path) -> bool:
    """False for a link, and for a name that no file can have, such as one that is too long."""
    try:
        return not path.is_symlink()
    except (OSError, ValueError):
        return False


def _outside(kind: ObjectType, name: str, value: float) -> str:
    """Clause on a size in SI that the task cannot simulate, as its field shows it; empty for any other."""
    low, high = SIZES_OF[kind][name]
    if low <= _in_si(name, _in_field(name, value)) <= high:
        return ""
    return f"{_UNITS[name].label} {_in_field(name, value):g} (it simulates {_range_text(kind, name)})"


def _outsides(kind: ObjectType, sizes: Iterable[tuple[str, float]]) -> str:
    found = (_outside(kind, name, value) for name, value in sizes if name in _UNITS and name in SIZES_OF[kind])
    return ", ".join(filter(None, found))


def _warning(found: MeasuredObject) -> str:
    """Sentence on measured sizes that the task cannot simulate; empty where there is none."""
    outside = _outsides(found.kind, ((size.name, size.value) for size in found.sizes))
    if not outside:
        return ""
    said = f"Outside of what the task can simulate: {outside}. Correct it below by hand; until then it is not saved."
    return f"<div class='dp'><small class='dp-bad'>{escape(said)}</small></div>"


def _require_simulable(description: ObjectDescription) -> None:
    """Raises ParameterError where a size is outside of what the task can simulate, as its field shows it."""
    kind = description.kind
    outside = _outsides(kind, description.sizes.items()) if kind is not None else ""
    if outside:
        raise ParameterError(f"Outside of what the task can simulate: {outside}. Correct it by hand.")


def _range_text(kind: ObjectType, name: str) -> str:
    """Range of a size in the unit of its field."""
    low, high = (_UNITS[name].scale * end for end in SIZES_OF[kind][name])
    return f"{low:g} to {high:g}"


def _in_field(name: str, value: float) -> float:
    """A size in SI as its field shows it."""
    return float(f"{_UNITS[name].scale * value:.4g}")


def _in_si(name: str, value: float) -> float:
    """The size in a field, in SI."""
    return float(f"{value / _UNITS[name].scale:.5g}")


def _step(about: float) -> float:
    """The next smaller of 1, 0.1, 0.01 and so on."""
    step = 1.0
    while step > about:
        step /= 10
    return step
