"""The panels beside the scene: mode, decision, plan, health, messages, cameras, plots. Redrawn where they changed."""

from typing import final

import numpy as np
import viser
from viser import theme

from app.core.messages import Frame
from app.ui import cards, doubt
from app.ui.board import Board
from app.ui.decision import DecisionForm
from app.ui.desk import Desk
from app.ui.plots import Plots
from app.ui.scene import Scene, thumbnail

_BRAND = (59, 130, 246)
_SIDE_WIDTH_PX = 330
_MAIN_WIDTH_PX = 400


@final
class Panel:
    """The widgets of one server. Used by the painter's thread alone; the buttons' callbacks go to the desk."""

    def __init__(self, server: viser.ViserServer, desk: Desk, scene: Scene) -> None:
        self._gui = server.gui
        self._scene = scene
        self._last = Board()
        self._pictures: dict[str, viser.GuiImageHandle] = {}
        self._mode = Text(self._gui, cards.mode(self._last, desk.now()))
        self._decision = DecisionForm(self._gui, desk)
        with self._gui.add_folder("Plan"):
            self._plan = Text(self._gui, cards.plan(self._last, desk.now()))
        with self._gui.add_folder("Is the model right?"):
            self._watch = Text(self._gui, doubt.watch(self._last))
        with self._gui.add_folder("Health"):
            self._health = Text(self._gui, cards.health(self._last, desk.now()))
        self._place_main()
        self._build_side()

    def paint(self, board: Board, now_s: float) -> None:
        """Bring the panels up to the board and the clock."""
        last, self._last = self._last, board
        self._mode.put(cards.mode(board, now_s))
        self._decision.paint(board, now_s)
        self._plan.put(cards.plan(board, now_s))
        self._watch.put(doubt.watch(board))
        self._verdict.put(doubt.verdict(board))
        self._health.put(cards.health(board, now_s))
        self._log.put(cards.log(board, now_s))
        self._episode.put(cards.episode(board))
        self._plots.paint(board)
        for name, picture in self._pictures.items():
            if picture.visible != (name in board.frames):
                picture.visible = name in board.frames
        for name, frame in board.frames.items():
            if frame is not last.frames.get(name):
                self._show_frame(name, frame)

    def _place_main(self) -> None:
        self._choose_theme(dark=True)
        self._gui.main_panel.dock_right()
        self._gui.main_panel.set_width(_MAIN_WIDTH_PX)

    def _choose_theme(self, *, dark: bool) -> None:
        self._gui.configure_theme(
            # Room for our own bar, see `page`.
            titlebar_content=theme.TitlebarConfig(buttons=(), image=None),
            dark_mode=dark,
            show_logo=False,
            show_share_button=False,
            brand_color=_BRAND,
        )

    def _build_side(self) -> None:
        side = self._gui.add_panel()
        with side.add_tab("Cell", viser.Icon.CAMERA):
            self._cameras = self._gui.add_folder(None)
            with self._gui.add_folder("Messages"):
                self._log = Text(self._gui, cards.log(self._last, 0.0))
        with side.add_tab("Progress", viser.Icon.CHART_LINE):
            self._plots = Plots(self._gui)
        with side.add_tab("Discovery", viser.Icon.MICROSCOPE):
            self._verdict = Text(self._gui, doubt.verdict(self._last))
        with side.add_tab("View", viser.Icon.EYE):
            self._gui.add_html(cards.key())
            self._add_switches()
            self._episode = Text(self._gui, cards.episode(self._last))
        side.dock_left()
        side.set_width(_SIDE_WIDTH_PX)

    def _add_switches(self) -> None:
        scene = self._scene
        for label, show, shown in (
            ("Observed", scene.observed.show, True),
            ("Goal", scene.goal.show, True),
            ("After this motion", scene.predicted.show, True),
            ("Last motion, as predicted", scene.expected.show, True),
            ("At the horizon", scene.horizon.show, False),
            ("Other branches", scene.paths.show_branches, True),
            ("Cameras", scene.show_cameras, True),
        ):
            switch = self._gui.add_checkbox(label, initial_value=shown)
            switch.on_update(lambda event, show=show: show(event.target.value))
        dark = self._gui.add_checkbox("Dark", initial_value=True)
        dark.on_update(lambda event: self._choose_theme(dark=event.target.value))

    def _show_frame(self, name: str, frame: Frame) -> None:
        picture: np.ndarray = thumbnail(frame.color)
        if name in self._pictures:
            self._pictures[name].image = picture
        else:
            with self._cameras:
                self._pictures[name] = self._gui.add_image(picture, label=name, format="jpeg", jpeg_quality=80)
        self._scene.look(frame, picture)


@final
class Text:
    """A piece of HTML in the panel that is sent only when it changed."""

    def __init__(self, gui: viser.GuiApi, content: str) -> None:
        self._handle = gui.add_html(content)

    def put(self, content: str) -> None:
        """Show `content`."""
        if content != self._handle.content:
            self._handle.content = content
