"""The widgets of a replay: play, speed, time, jumps; and the form that plans a moment again.

They stand in a panel of their own at the bottom of the scene. They move nothing real, so anybody may use them.
"""

import math
import time
from typing import Any, Final, final

import viser

from app.ui import replanning
from app.ui.panel import Text
from app.ui.player import FASTEST, Player, Reel, Where
from app.ui.replanning import AS_RECORDED, ReplanRequest

SPEEDS: Final = {
    f"{speed:g}\N{MULTIPLICATION SIGN}": speed for speed in (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
} | {"as fast as possible": FASTEST}
PREVIOUS, NEXT = "Previous motion", "Next motion"
PLAY, PAUSE = "Play", "Pause"
JUMP: Final = "Jump to \N{HORIZONTAL ELLIPSIS}"

_WIDTH_PX, _MARGIN_PX = 560, 15
_STEPS = 2000
"""Steps of the slider: about its width in pixels."""
_LABELS = 12
"""Most labels that fit below the slider."""
_MOST_MARKS = 500
_HELD_S = 0.7
"""Time after a user's move during which the program does not move the slider."""


@final
class Playback:
    """The widgets of one server. Painted by the painter's thread alone; callbacks go to the player."""

    def __init__(self, server: viser.ViserServer, player: Player) -> None:
        self._gui, self._player = server.gui, player
        self._moved_s, self._put_s = -math.inf, 0.0
        panel = server.gui.add_panel()
        with panel.add_tab("Replay", viser.Icon.PLAYER_PLAY):
            self._build_transport(player.reel)
        with panel.add_tab("Plan again", viser.Icon.ROUTE):
            self._build_form(player.reel)
        panel.float(x=_MARGIN_PX, y=-_MARGIN_PX, width=_WIDTH_PX)

    def paint(self) -> None:
        """Update the widgets to the player."""
        where = self._player.where
        self._text.put(moment_text(self._player.reel, where))
        if self._play.label != (label := PAUSE if where.playing else PLAY):
            self._play.label = label
            self._play.icon = viser.Icon.PLAYER_PAUSE if where.playing else viser.Icon.PLAYER_PLAY
        if where.time_s != self._put_s and time.monotonic() - self._moved_s > _HELD_S:
            # Not to its present value: that might undo a move whose callback is on its way.
            self._put_s = where.time_s
            self._time.value = min(round(where.time_s / self._time.step) * self._time.step, self._time.max)
        if (speed := _speed_name(where.speed)) != self._speed.value and speed in SPEEDS:
            self._speed.value = speed
        self._card.put(replanning.card(self._player.replanned, self._player.said))
        if self._again.disabled != (busy := self._player.pending_request() is not None):
            self._again.disabled = busy

    def _build_transport(self, reel: Reel) -> None:
        gui, player = self._gui, self._player
        self._text = Text(gui, moment_text(reel, player.where))
        end_s = max(reel.duration_s, 1e-3)
        self._time = gui.add_slider(
            "Time [s]",
            min=0.0,
            max=end_s,
            step=_step(end_s),
            initial_value=0.0,
            marks=_labels(reel),
            hint="The numbers below are motions, where they begin",
        )
        self._time.on_update(self._scrub)
        self._play = gui.add_button(PLAY, icon=viser.Icon.PLAYER_PLAY)
        self._play.on_click(lambda _: player.toggle())
        motions = gui.add_button_group("Step", (PREVIOUS, NEXT))
        motions.on_click(lambda event: player.step(1 if event.target.value == NEXT else -1))
        self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value=_nearest_speed(player.where.speed))
        self._speed.on_update(lambda event: event.client and player.set_speed(SPEEDS[event.target.value]))
        self._build_places(reel)

    def _build_places(self, reel: Reel) -> None:
        """List of the events; choosing one jumps to it."""
        places = {f"{mark.time_s:.2f} s: {mark.text}"[:100]: mark.time_s for mark in reel.marks[:_MOST_MARKS]}
        places_listed = self._gui.add_dropdown("Moments", (JUMP, *places), disabled=not places)

        def chosen(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None and (time_s := places.get(event.target.value)) is not None:
                self._player.jump(time_s)
                event.target.value = JUMP

        places_listed.on_update(chosen)

    def _build_form(self, reel: Reel) -> None:
        gui, player = self._gui, self._player
        form = gui.add_form(None)
        with form:
            model = gui.add_dropdown("Model", (AS_RECORDED, *reel.models))
            path = gui.add_text(
                "or a file", player.model, hint="A model.toml on the machine that replays; it goes first"
            )
            self._again = gui.add_button("Plan from here", icon=viser.Icon.ROUTE)
        self._card = Text(gui, replanning.card(None, ""))

        def asked(_: viser.GuiEvent[Any]) -> None:
            player.order(ReplanRequest(time_s=player.where.time_s, model=model.value, path=path.value.strip()))

        self._again.on_click(asked)
        form.on_submit(asked)

    def _scrub(self, event: viser.GuiEvent[Any]) -> None:
        """Handle a user's move of the slider; the program's own moves have no client."""
        if event.client is not None:
            self._moved_s = time.monotonic()
            self._player.jump(event.target.value)


def moment_text(reel: Reel, where: Where) -> str:
    """The moment in words."""
    passed = sum(mark.time_s <= where.time_s for mark in reel.motions)
    motion = f"motion {passed} of {len(reel.motions)}" if reel.motions else "no motions"
    doing = f"playing {_speed_name(where.speed)}" if where.playing else "paused"
    return (
        f'<div class="dp" role="status"><b>{where.time_s:.2f} s</b> of {reel.duration_s:.2f} s '
        f"<small>{motion}, {doing}</small></div>"
    )


def _speed_name(speed: float) -> str:
    return next((name for name, known in SPEEDS.items() if known == speed), f"{speed:g}\N{MULTIPLICATION SIGN}")


def _nearest_speed(speed: float) -> str:
    """The nearest listed speed."""
    return min(SPEEDS, key=lambda name: abs(math.log(min(SPEEDS[name], 1e3) / min(speed, 1e3))))


def _step(end_s: float) -> float:
    """A round number of seconds, about the width of a pixel."""
    return 10.0 ** math.ceil(math.log10(end_s / _STEPS))


def _labels(reel: Reel) -> tuple[tuple[float, str], ...]:
    every = math.ceil(len(reel.motions) / _LABELS)
    return tuple(
        (mark.time_s, str(number) if number % every == 0 else "") for number, mark in enumerate(reel.motions, start=1)
    )
