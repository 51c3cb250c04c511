"""The tab that sets a goal: from the view, drawn over the table, or from a file."""

import math
import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from html import escape
from typing import Any, Final, final

import numpy as np
import viser

from app.core.dialogue import words
from app.core.dialogue.requests import GoalRequest, GoalSource
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import fresh_id
from app.core.types import Points
from app.ui.goals.draft import KINDS, LEAST_RADIUS_M, GoalDraft, Kind, on_table
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController
from app.ui.server.message_validation import DRAFT
from app.ui.view.particle_cloud import ParticleView

_NOTHING: Final = next(name for name, kind in KINDS.items() if kind == "none")
_SOURCES: Final[dict[Kind, GoalSource]] = {"copy": "copy", "curve": "curve", "region": "region"}
_SHARPEST_1_M, _WIDEST_M = 15.0, 0.25
_LINE_M = 0.003
"""Height of the line above the table, so that it stays visible."""


@final
class GoalTab:
    """Widgets in the container that is open when this is made, and the draft in the scene.

    Callbacks change the draft, in any thread; only the painter's thread draws. All browsers draw on the same draft.
    """

    def __init__(self, server: viser.ViserServer, controller: OperatorController) -> None:
        self._server, self._controller = server, controller
        self._changing = threading.Lock()
        self._draft, self._drawn = GoalDraft(), GoalDraft()
        self._object: Points | None = None
        self._last = ConsoleState()
        gui = server.gui
        self._said = gui.add_html(card(self._last, None))
        view = gui.add_button("Current view as goal", color="gray", icon=viser.Icon.CAMERA)
        view.on_click(self._use_view)
        self._kind = gui.add_dropdown("Draw", tuple(KINDS), initial_value=_NOTHING)
        self._bend = gui.add_slider("Bend [1/m]", -_SHARPEST_1_M, _SHARPEST_1_M, 0.1, 0.0, visible=False)
        self._radius = gui.add_slider("Radius [m]", LEAST_RADIUS_M, _WIDEST_M, 0.005, 0.08, visible=False)
        self._points = gui.add_button_group("Points", ("Undo", "Clear"), visible=False)
        self._hint = gui.add_html(_hint("none"))
        self._use = gui.add_button("Use as goal", color="green", icon=viser.Icon.TARGET, visible=False)
        self._kind.on_update(lambda event: self._choose(KINDS.get(event.target.value, "none")))
        self._bend.on_update(lambda event: self._change(bend_1_m=float(event.target.value)))
        self._radius.on_update(lambda event: self._change(radius_m=float(event.target.value)))
        self._points.on_click(self._unpoint)
        self._use.on_click(self._use_draft)
        self._files = gui.add_html(files(()))
        self._beads = ParticleView(server, "/draft/goal", palette.DRAFT, opacity=0.6)
        self._gizmo = server.scene.add_transform_controls(
            DRAFT, scale=0.12, active_axes=(True, True, False), depth_test=False, visible=False
        )
        self._gizmo.on_update(self._on_drag)
        self._line: viser.LineSegmentsHandle | None = None

    def paint(self, state: ConsoleState) -> None:
        """Draw the draft, and show the object's distance from the goal, and from the draft."""
        draft, last, self._last = self._draft, self._last, state
        if state.frames.keys() != last.frames.keys():
            self._files.content = files(sorted(state.frames))
        same = draft is self._drawn and state.particles is last.particles and state.goal is last.goal
        if same or state.particles is None:
            return
        if draft.kind != self._drawn.kind:
            self._begin(draft, state.particles.positions)
        self._drawn = draft
        goal = draft.positions(self._object) if self._object is not None else None
        if goal is None:
            self._beads.clear()
        else:
            self._beads.put(goal)
        self._draw_line(draft)
        self._said.content = card(state, goal)
        self._use.visible = goal is not None

    def _begin(self, draft: GoalDraft, object_: Points) -> None:
        """Begin a draft of another kind, with the object as it is now, which is kept until the next one."""
        kind = draft.kind
        self._object = object_
        self._bend.visible, self._radius.visible = kind == "copy", kind == "region"
        self._points.visible = kind == "curve"
        self._hint.content = _hint(kind)
        self._gizmo.visible = kind in ("copy", "region")
        self._gizmo.disable_rotations = kind == "region"
        self._gizmo.position = (*draft.place, _LINE_M)
        self._gizmo.wxyz = (1.0, 0.0, 0.0, 0.0)
        self._server.scene.remove_click_callback("all")
        if kind == "curve":
            self._server.scene.on_click()(self._on_click)

    def _choose(self, kind: Kind) -> None:
        seen = self._controller.state.particles
        middle = seen.positions[:, :2].mean(0) if seen is not None else np.zeros(2)
        begun = GoalDraft(kind=kind, place=(float(middle[0]), float(middle[1])), radius_m=float(self._radius.value))
        self._bend.value = 0.0
        self._redraw(lambda _: begun)

    def _change(self, **changes: Any) -> None:
        self._redraw(lambda draft: replace(draft, **changes))

    def _redraw(self, changed: Callable[[GoalDraft], GoalDraft]) -> None:
        with self._changing:
            self._draft = changed(self._draft)
        self._controller.changed.set()

    def _on_drag(self, event: viser.TransformControlsEvent) -> None:
        (w, _, _, z), (x_m, y_m, _) = event.target.wxyz, event.target.position
        self._change(place=(float(x_m), float(y_m)), turn_rad=2 * math.atan2(float(z), float(w)))

    def _on_click(self, event: viser.SceneClickEvent) -> None:
        place = on_table(event.ray_origin, event.ray_direction)
        if place is not None:
            self._redraw(lambda draft: draft.with_point(*place))

    def _unpoint(self, event: viser.GuiEvent[Any]) -> None:
        kept = -1 if event.target.value == "Undo" else 0
        self._redraw(lambda draft: replace(draft, curve=draft.curve[:kept]))

    def _draw_line(self, draft: GoalDraft) -> None:
        if self._line is not None:
            self._line.remove()
            self._line = None
        if draft.kind == "curve" and draft.curve:
            nodes = np.column_stack([np.array(draft.curve), np.full(len(draft.curve), _LINE_M)])
            ends = nodes[1:] if len(nodes) > 1 else nodes + np.array([0.004, 0.0, 0.0])
            starts = nodes[:-1] if len(nodes) > 1 else nodes
            self._line = self._server.scene.add_line_segments(
                "/draft/curve", np.stack([starts, ends], axis=1), palette.DRAFT, thickness=4.0, thickness_units="screen"
            )

    def _use_view(self, event: viser.GuiEvent[Any]) -> None:
        seen = self._controller.state.particles
        if seen is not None:
            self._ask(event, "view", seen.positions)

    def _use_draft(self, event: viser.GuiEvent[Any]) -> None:
        """End the draft before the goal is requested: its viewers may begin the next one at once.

        It stays where another operator has control, so that the goal will be refused.
        """
        draft, object_ = self._draft, self._object
        goal = draft.positions(object_) if object_ is not None else None
        if goal is not None:
            if self._controller.state.open_to(operator(event)):
                self._kind.value = _NOTHING
            self._ask(event, _SOURCES[draft.kind], goal)

    def _ask(self, event: viser.GuiEvent[Any], source: GoalSource, positions: Points) -> None:
        now_s, who = self._controller.now(), operator(event)
        self._controller.ask(
            GoalRequest(id=fresh_id("goal"), time_s=now_s, operator=who, source=source, positions=positions)
        )


def card(state: ConsoleState, draft: Points | None) -> str:
    """Card of the object's distance from its goal, and from the drawn one."""
    if state.particles is None or state.goal is None:
        return '<div class="dp"><small>No goal, or nothing seen yet.</small></div>'
    x = state.particles.positions
    now = float(chamfer_m2(x, state.goal.positions))
    said = f'<div class="dp-big"><b>{words.distance(now)}</b><i>from the goal</i><em>{words.square(now)}</em></div>'
    if draft is not None:
        drawn = float(chamfer_m2(x, draft))
        said += f"<p>From what is drawn: <b>{words.distance(drawn)}</b> <small>{words.square(drawn)}</small></p>"
    return f'<div class="dp">{said}</div>'


def files(cameras: Iterable[str]) -> str:
    """HTML of the file input; the page's script sends the files."""
    options = "".join(f"<option>{escape(name)}</option>" for name in cameras)
    return (
        '<div class="dp"><h3>Of a file</h3><p><small>Points [m] as .npy, .npz or .ply; or a colour picture and a '
        "16-bit depth picture of one camera.</small></p>"
        '<input type="file" data-goal-files multiple accept=".npy,.npz,.ply,.png,.jpg,.jpeg" '
        'aria-label="Goal of a file">'
        f"<p><label>Camera of the pictures <select data-goal-camera>{options}</select></label></p>"
        '<p data-goal-says role="status"></p></div>'
    )


def _hint(kind: Kind) -> str:
    said = {
        "none": "",
        "copy": "Drag the handle in the scene to move and turn it.",
        "curve": "Click on the table, point after point, from one end of the object to the other.",
        "region": "Drag the handle in the scene to move it.",
    }[kind]
    return f'<div class="dp"><small>{said}</small></div>'
