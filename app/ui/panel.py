"""The panels beside the scene: mode, decision, plan, health, and tabs with the rest. Redrawn on changes."""

from pathlib import Path
from typing import final

import viser
from viser import theme

from app.config import Timing
from app.ui.goals import GoalTab
from app.ui.parts import cards
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import DecisionForm
from app.ui.parts.drift import DriftMeter
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.plots import Plots
from app.ui.parts.text import Text
from app.ui.placing import PlacingTab
from app.ui.plans import Plans
from app.ui.tabs import model_monitor_panel
from app.ui.tabs.by_hand import HandForm
from app.ui.tabs.cell import CellTab
from app.ui.tabs.checklist import ChecklistForm
from app.ui.tabs.demonstrations import DemonstrationForm
from app.ui.tabs.modelling import ModelTab
from app.ui.tabs.modes import EndButton, ModeForm
from app.ui.tabs.object_wizard import ObjectTab
from app.ui.tabs.probing import ProbeForm
from app.ui.view.scene import ConsoleScene

_BRAND = (59, 130, 246)
_SIDE_WIDTH_PX = 330
_MAIN_WIDTH_PX = 400


@final
class Panel:
    """The widgets of one server. Used by the painter's thread alone; the buttons' callbacks go to the controller."""

    def __init__(
        self, server: viser.ViserServer, controller: OperatorController, scene: ConsoleScene, timing: Timing
    ) -> None:
        self._server, self._gui = server, server.gui
        self._controller, self._scene = controller, scene
        self._last = ConsoleState()
        self._drift = DriftMeter(timing)
        self._mode = Text(self._gui, cards.mode(self._last, controller.now()))
        commands = not controller.state.replay
        self._checklist = ChecklistForm(self._gui, controller) if commands else None
        self._decision = DecisionForm(self._gui, controller) if commands else None
        self._modes: ModeForm | None = None
        self._by_hand: HandForm | None = None
        if commands:
            with self._gui.add_folder("Mode"):
                self._modes = ModeForm(self._gui, controller)
                self._by_hand = HandForm(self._gui, controller)
        with self._gui.add_folder("Plan"):
            self._plan = Text(self._gui, cards.plan(self._last, controller.now()))
        self._demonstrations: DemonstrationForm | None = None
        if commands:
            with self._gui.add_folder("Demonstrations", expand_by_default=False):
                self._demonstrations = DemonstrationForm(self._gui, controller)
        with self._gui.add_folder("Is the model right?"):
            self._watch = Text(self._gui, model_monitor_panel.watch(self._last))
        with self._gui.add_folder("Health"):
            self._health = Text(self._gui, cards.health(self._last, controller.now()))
        self._place_main()
        self._build_side(commands=commands)

    def paint(self, state: ConsoleState, now_s: float) -> None:
        """Update the panels to the state and the clock."""
        self._mode.put(cards.mode(state, now_s))
        if self._checklist is not None:
            self._checklist.paint(state)
        if self._decision is not None:
            self._decision.paint(state, now_s)
        if self._modes is not None:
            self._modes.paint(state)
        if self._by_hand is not None:
            self._by_hand.paint(state)
        if self._demonstrations is not None:
            self._demonstrations.paint(state)
        if self._goal is not None:
            self._goal.paint(state)
        if self._placing is not None:
            self._placing.paint(state)
        if self._object is not None:
            self._object.paint(state)
        self._plan.put(cards.plan(state, now_s, self._drift.since(state)))
        self._plans.paint(state)
        self._watch.put(model_monitor_panel.watch(state))
        self._verdict.put(model_monitor_panel.verdict(state))
        self._health.put(cards.health(state, now_s))
        self._episode.put(cards.episode(state))
        self._plots.paint(state)
        self._modelling.paint(state)
        self._cell.paint(state, now_s)

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

    def _build_side(self, *, commands: bool) -> None:
        server, controller, side = self._server, self._controller, self._gui.add_panel()
        with side.add_tab("Cell", viser.Icon.CAMERA):
            self._cell = CellTab(server, controller, self._scene)
        self._goal: GoalTab | None = None
        self._placing: PlacingTab | None = None
        self._object: ObjectTab | None = None
        if commands:
            with side.add_tab("Goal", viser.Icon.TARGET):
                self._goal = GoalTab(server, controller)
            with side.add_tab("Object", viser.Icon.RULER_MEASURE):
                self._object = ObjectTab(self._gui, controller, Path.cwd())
            with side.add_tab("Calibrate", viser.Icon.GRID_DOTS):
                self._placing = PlacingTab(server, controller)
        with side.add_tab("Plans", viser.Icon.GIT_BRANCH):
            self._plans = Plans(server, controller, self._scene)
        with side.add_tab("Progress", viser.Icon.CHART_LINE):
            self._plots = Plots(self._gui)
        with side.add_tab("Model", viser.Icon.ADJUSTMENTS):
            self._modelling = ModelTab(self._gui, controller, Path.cwd())
        with side.add_tab("Discovery", viser.Icon.MICROSCOPE):
            if commands:
                ProbeForm(self._gui, controller)
            self._verdict = Text(self._gui, model_monitor_panel.verdict(self._last))
        with side.add_tab("View", viser.Icon.EYE):
            self._gui.add_html(cards.key())
            self._add_switches()
            self._episode = Text(self._gui, cards.episode(self._last))
            if commands:
                EndButton(self._gui, controller)
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
