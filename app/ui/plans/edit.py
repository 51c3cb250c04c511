"""Editing of a motion by its ends: two handles in the scene, the changed path, and the buttons for it."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
import viser

from app.core.messages import Proposal
from app.core.path_similarity_transform import is_level, reshape
from app.core.types import Path3
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController
from app.ui.plans.ghosts import Way
from app.ui.plans.look import PreviewState
from app.ui.server.message_validation import ENDS

_HANDLE_M = 0.12


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MotionEdit:
    """A motion being edited: the path of branch `index` of `proposal`, and the handles of its ends."""

    proposal: Proposal
    index: int
    way: Path3
    handles: tuple[viser.TransformControlsHandle, viser.TransformControlsHandle]

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the handles, at the height of the path [m]."""
        start, end = (np.array([*handle.position[:2], self.way[0, 2]], np.float64) for handle in self.handles)
        return start, end


@final
class EditForm:
    """Form in the container that is open when this is made. Painted by the painter's thread alone.

    Handles belong to one branch of one plan: they are removed with either, and a later press has no effect.
    """

    def __init__(self, server: viser.ViserServer, controller: OperatorController) -> None:
        self._scene, self._controller = server.scene, controller
        self._way = Way(server, "/edit/way", palette.LOOKED)
        self._drawn: tuple[float, ...] = ()
        self._draft: MotionEdit | None = None
        hint = "Drag the ends of the motion that is looked at over the table"
        self._switch = server.gui.add_checkbox("Edit this motion", initial_value=False, disabled=True, hint=hint)
        self._simulate = server.gui.add_button("Simulate this instead", icon=viser.Icon.PENCIL, disabled=True)
        self._switch.on_update(lambda _: controller.changed.set())
        self._simulate.on_click(self._ask)

    @property
    def editing(self) -> bool:
        """True while there are handles."""
        return self._draft is not None

    def paint(self, state: ConsoleState, look: PreviewState | None) -> None:
        """Show handles while the switch is on and the plan may still be decided on, and the path between them."""
        editable = look is not None and state.decidable and state.pending is look.proposal and _is_push(look)
        if self._switch.disabled == editable:
            self._switch.disabled = not editable
        draft = self._draft
        another = draft is not None and look is not None and look.proposal is not draft.proposal
        if self._switch.value and (another or not editable):
            self._switch.value = False
        wanted = look if editable and self._switch.value else None
        if draft and (wanted is None or draft.index != wanted.at):
            self._put_away(draft)
        if wanted and self._draft is None:
            self._draft = self._begin_edit(wanted)
        disabled = self._draft is None or state.edit is not None
        if self._simulate.disabled != disabled:
            self._simulate.disabled = disabled
        self._draw()

    def _begin_edit(self, look: PreviewState) -> MotionEdit:
        way = look.branch.tool_path.astype(np.float64)
        start, end = (
            self._scene.add_transform_controls(
                name,
                scale=_HANDLE_M,
                active_axes=(True, True, False),
                disable_rotations=True,
                depth_test=False,
                position=place,
            )
            for name, place in zip(ENDS, way[[0, -1]], strict=True)
        )
        for handle in (start, end):
            handle.on_update(lambda _: self._controller.changed.set())
        return MotionEdit(proposal=look.proposal, index=look.at, way=way, handles=(start, end))

    def _put_away(self, draft: MotionEdit) -> None:
        self._draft = None
        for handle in draft.handles:
            handle.remove()

    def _draw(self) -> None:
        """Draw the changed path again where a handle was moved."""
        if self._draft is None:
            self._drawn = ()
            self._way.put(None)
            return
        ends = self._draft.ends
        places = (*ends[0], *ends[1])
        if places != self._drawn:
            self._drawn = places
            self._way.put(reshape(self._draft.way, *ends))

    def _ask(self, event: viser.GuiEvent[Any]) -> None:
        draft = self._draft
        if draft is not None:
            self._controller.edit(draft.proposal, draft.index, *draft.ends, operator(event))


def _is_push(look: PreviewState) -> bool:
    return is_level(look.branch.tool_path.astype(np.float64))
