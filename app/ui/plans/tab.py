"""The widgets of the tab Plans. All browsers share them, so spectators see the same selection."""

from typing import final

import viser

from app.core.messages import Proposal
from app.core.types import Points
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController
from app.ui.plans import cards
from app.ui.plans.edit import EditForm
from app.ui.plans.ghosts import Ghosts
from app.ui.plans.look import BEST, NONE, PreviewState, last_moment, names, selected_preview
from app.ui.view.scene import ConsoleScene
from app.ui.view.tool import Flat


@final
class Plans:
    """Widgets in the container that is open when this is made. Painted by the painter's thread alone."""

    def __init__(self, server: viser.ViserServer, controller: OperatorController, scene: ConsoleScene) -> None:
        gui = server.gui
        self._scene = scene
        self._ghosts = Ghosts(server)
        self._shown: Proposal | None = None
        self._drawn: tuple[object, ...] = ()
        self._at = gui.add_dropdown("Look at", (BEST,), initial_value=BEST)
        self._beside = gui.add_dropdown("Compare with", (NONE,), initial_value=NONE)
        hint = "From now to the end of the motions that were thought through"
        self._moment = gui.add_slider("Moment", 0, 1, 1, 0, hint=hint, disabled=True)
        self._there = gui.add_html("")
        self._edit = EditForm(server, controller)
        self._table = gui.add_html(cards.NO_PLAN)
        for widget in (self._at, self._beside, self._moment):
            widget.on_update(lambda _: controller.changed.set())

    def paint(self, state: ConsoleState) -> None:
        """Update the tab to the state and the widgets."""
        if state.shown is not self._shown:
            self._shown = state.shown
            self._offer(state.shown)
            self._ghosts.become(Flat.of(state.episode.task) if state.episode else None)
        proposal = state.shown
        look = selected_preview(proposal, self._at.value, self._beside.value, self._moment.value) if proposal else None
        inputs = (proposal, state.goal, look and (look.at, look.beside, look.share))
        if inputs != self._drawn:
            self._drawn = inputs
            self._draw(look, state.goal.positions if state.goal else None)
        self._edit.paint(state, look)
        self._scene.playing = not (self._edit.editing or (look is not None and look.share > 0))

    def _offer(self, proposal: Proposal | None) -> None:
        """Offer the branches of a plan, beginning with the proposed one, now."""
        known = names(proposal) if proposal else ()
        for widget, first in ((self._at, BEST), (self._beside, NONE)):
            widget.options = (first, *known)
            widget.value = first
        self._moment.value = 0
        self._moment.max = last_moment(proposal) if proposal else 1
        self._moment.disabled = proposal is None

    def _draw(self, look: PreviewState | None, goal: Points | None) -> None:
        self._ghosts.paint(look)
        self._there.content = cards.moment(look, goal) if look else ""
        self._table.content = cards.branches(look.proposal, look) if look else cards.NO_PLAN
