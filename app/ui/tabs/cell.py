"""The tab of the cell: each camera's picture with its segmentation, colours, clouds, messages."""

from collections.abc import Iterable
from datetime import UTC, date, datetime
from typing import Final, NamedTuple, final

import numpy as np
import viser
from jaxtyping import Bool

from app.core.colours import ColourRange, colour_mask
from app.core.messages import Frame
from app.core.types import ColourImage
from app.ui.parts import cards, palette
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.text import Text
from app.ui.tabs.tuning import Tuning
from app.ui.view import overlays, views
from app.ui.view.clouds import SHOWN, Clouds, Show
from app.ui.view.scene import ConsoleScene

_NONE: Final = "none"
_LIVE_S: Final = 3.0
"""Age of a mask up to which it belongs to the picture that is shown, or soon will."""
_LARGE_PX: Final = 660.0
_QUALITY: Final = 80


@final
class CellTab:
    """Drawn into the container that is open when this is made."""

    def __init__(self, server: viser.ViserServer, controller: OperatorController, scene: ConsoleScene) -> None:
        gui = server.gui
        self._gui, self._scene, self._clouds = gui, scene, Clouds(server)
        self._views: dict[str, CameraPicture] = {}
        self._summary = Text(gui, views.summary(controller.state))
        self._masked = gui.add_checkbox("Mask", initial_value=True, hint="Tint what is taken for the object")
        self._place = gui.add_folder(None)
        self._larger = gui.add_dropdown("Larger", _or_none(()))
        self._large = Large(gui)
        self._tuning = Tuning(gui, controller)
        with gui.add_folder("Clouds"):
            cameras = gui.add_dropdown("Of the cameras", SHOWN)
            surface = gui.add_checkbox("Fused surface", initial_value=False)
            self._counts = Text(gui, views.clouds({}))
        cameras.on_update(lambda event: self._show(event.target.value))
        surface.on_update(lambda event: setattr(self._clouds, "surface", event.target.value))
        with gui.add_folder("Messages"):
            self._log = Text(gui, cards.log(controller.state, 0.0))

    def paint(self, state: ConsoleState, now_s: float) -> None:
        """Bring the tab up to the state and the clock."""
        wanted, today = self._tuning.paint(state), datetime.now(UTC).date()
        self._summary.put(views.summary(state))
        for name, frame in state.frames.items():
            self._view(name, frame).paint(state, frame, wanted, now_s, masked=self._masked.value, today=today)
        self._large.paint(self._views.get(self._larger.value))
        self._clouds.paint(state)
        self._counts.put(views.clouds(self._clouds.counts))
        self._log.put(cards.log(state, now_s))

    def _show(self, chosen: Show) -> None:
        if chosen in SHOWN:
            self._clouds.cameras = chosen

    def _view(self, name: str, frame: Frame) -> "CameraPicture":
        if name not in self._views:
            with self._place:
                self._views[name] = CameraPicture(self._gui, self._scene, frame)
            self._larger.options = _or_none(self._views)
        return self._views[name]


@final
class _Painted(NamedTuple):
    """An image, the mask to tint, thinned or not, and the colour; painted at the displayed size."""

    image: ColourImage
    mask: Bool[np.ndarray, "_ _"] | None
    ink: palette.Colour

    def small(self) -> ColourImage:
        """The image at the size of the panel."""
        image = overlays.thin_out(self.image)
        if self.mask is None:
            return image
        step = overlays.stride(self.mask.shape[1])
        return overlays.tint(image, overlays.enlarge_mask(self.mask[::step, ::step], image.shape), self.ink)

    def whole(self) -> ColourImage:
        """The image with all its pixels."""
        if self.mask is None:
            return self.image
        return overlays.tint(self.image, overlays.enlarge_mask(self.mask, self.image.shape), self.ink)


@final
class CameraPicture:
    """One camera's picture and its caption."""

    def __init__(self, gui: viser.GuiApi, scene: ConsoleScene, frame: Frame) -> None:
        self._scene = scene
        self.painted = _Painted(frame.color, None, palette.MASK)
        self._image = gui.add_image(
            overlays.thin_out(frame.color), label=frame.camera.name, format="jpeg", jpeg_quality=_QUALITY
        )
        self._text = Text(gui, "")
        self._shown: Frame | None = None
        self._drawn: tuple[object, ...] = ()
        self._previewed: int | None = None

    def paint(
        self, state: ConsoleState, frame: Frame, wanted: ColourRange | None, now_s: float, *, masked: bool, today: date
    ) -> None:
        """Show the newest picture, with the mask in use or that of the colours `wanted`."""
        if frame is not self._shown:
            self._shown = frame
            self._scene.look(frame, overlays.thin_out(frame.color))
        mask_of = state.seen if masked and wanted is None else None
        live = mask_of is not None and now_s - mask_of.time_s < _LIVE_S
        # Every mask comes with its own picture: drawing the two apart would show each picture twice.
        drawn = (mask_of if live else frame, wanted, masked)
        if drawn != self._drawn:
            self._drawn = drawn
            self._draw(state, frame, wanted, masked=masked)
        self._text.put(views.camera(state, frame, now_s, today=today, previewed=self._previewed))

    def _draw(self, state: ConsoleState, frame: Frame, wanted: ColourRange | None, *, masked: bool) -> None:
        mask, ink, self._previewed = None, palette.MASK, None
        if wanted is not None:
            mask, ink = colour_mask(frame.color, wanted), palette.PREVIEW
            self._previewed = int(np.count_nonzero(mask))
        elif masked and state.seen is not None:
            mask = state.seen.masks.get(frame.camera.name)
        self.painted = _Painted(frame.color, mask, ink)
        self._image.image = self.painted.small()


@final
class Large:
    """A window of its own with one camera's picture in all its pixels; hidden while none is chosen."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._panel = gui.add_panel(visible=False)
        with self._panel.add_tab("Camera", viser.Icon.ZOOM_IN):
            self._image = gui.add_image(np.zeros((2, 2, 3), np.uint8), format="jpeg", jpeg_quality=_QUALITY)
        self._panel.float(x=20, y=20, width=_LARGE_PX)
        self._drawn: _Painted | None = None

    def paint(self, view: CameraPicture | None) -> None:
        """Show the picture of that view."""
        if self._panel.visible != (view is not None):
            self._panel.visible = view is not None
        if view is not None and view.painted is not self._drawn:
            self._drawn = view.painted
            self._image.image = view.painted.whole()


def _or_none(names: Iterable[str]) -> tuple[str, ...]:
    return (_NONE, *names)
