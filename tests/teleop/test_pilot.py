"""From a browser's samples to jogs at the arm, and what the browser is told."""

import json

import numpy as np
import pytest

from app.config import Limits
from app.core.dialogue.jog import Jog
from app.core.motion import pointing_down
from app.teleop.pilot import Pilot

LIMITS = Limits()


class Hand:
    """A page that speaks 30 times a second, and an arm that notes what it is told."""

    def __init__(self) -> None:
        self.now_s, self.sequence, self.accepts_jog = 0.0, 0, True
        self.jogs = list[Jog]()
        self.pilot = Pilot(
            jog=self.jog, tool=lambda: pointing_down(np.array([0.5, 0, 0.2])), limits=LIMITS, now=self.now
        )

    def now(self) -> float:
        return self.now_s

    def jog(self, jog: Jog) -> bool:
        if self.accepts_jog:
            self.jogs.append(jog)
        return self.accepts_jog

    def says(self, *, pressed: int = 1, who: str = "client 0", refused: str | None = None, **more: object) -> str:
        self.now_s += 1 / 30
        self.sequence += 1
        said = {"held": True, "axes": {"x": 1}, "pressed": pressed, "sequence": self.sequence, "speed": 0.5} | more
        return self.pilot.sample(who, json.dumps(said).encode(), refused=refused)

    @property
    def last(self) -> np.ndarray:
        return self.jogs[-1].linear


def test_what_is_held_reaches_the_arm_and_a_release_too() -> None:
    hand = Hand()
    assert hand.says() == "moving"
    assert hand.last == pytest.approx([0.5 * LIMITS.speed_m_s, 0, 0])
    assert hand.says(axes={}) == "live, nothing held that moves"
    assert hand.says(held=False) == "released"
    assert not hand.last.any()
    count = len(hand.jogs)
    assert hand.says() == "released"
    assert len(hand.jogs) == count
    assert hand.says(pressed=2) == "moving"


def test_who_may_not_is_told_why_and_needs_a_new_press_once_he_may() -> None:
    hand = Hand()
    assert hand.says(refused="client 1 has control") == "client 1 has control"
    assert hand.says() == "client 1 has control"
    assert hand.jogs == []
    assert hand.says(pressed=2) == "moving"
    assert hand.says(pressed=2, refused="a stop is in force") == "a stop is in force"
    assert not hand.last.any()
    assert hand.says(pressed=2) == "a stop is in force"
    assert not hand.last.any()


def test_where_the_arm_does_not_heed_a_new_press_is_wanted() -> None:
    hand = Hand()
    hand.accepts_jog = False
    assert "busy" in hand.says()
    hand.accepts_jog = True
    assert "busy" in hand.says()
    assert hand.jogs == []
    assert hand.says(pressed=2) == "moving"


def test_a_gap_wants_a_new_press() -> None:
    hand = Hand()
    hand.says()
    hand.now_s += 0.2
    assert "press again" in hand.says()
    assert not hand.last.any()
    assert "press again" in hand.says()


def test_the_aim_is_gone_to_and_lies_in_the_workspace() -> None:
    hand = Hand()
    assert hand.says(towards=True) == "there is no aim to go to"
    hand.pilot.aim(np.array([np.nan, 0.0, 0.0]))
    assert hand.says(towards=True) == "there is no aim to go to"
    hand.pilot.aim(np.array([0.5, 5.0, 0.2]))
    assert hand.says(towards=True) == "moving"
    assert hand.last == pytest.approx([0, 0.5 * LIMITS.speed_m_s, 0])
    hand.pilot.aim(np.array([0.5, 0.0, 0.2]))
    assert hand.says(towards=True) == "there"


@pytest.mark.parametrize("data", [b"", b"{}", b"nonsense", b'{"held": true}'])
def test_nonsense_is_refused_in_words_and_moves_nothing(data: bytes) -> None:
    hand = Hand()
    assert "makes no sense" in hand.pilot.sample("client 0", data, refused=None)
    assert hand.jogs == []


def test_a_browser_that_is_lost_lets_go_and_each_has_a_dead_man_of_its_own() -> None:
    hand = Hand()
    hand.says(pressed=4)
    hand.says(who="client 1", refused="client 0 has control", pressed=9)
    assert hand.says(pressed=4) == "moving"
    hand.pilot.let_go("client 0")
    assert not hand.last.any()
    assert "press again" in hand.says(pressed=4)
    assert not hand.last.any()
    assert hand.says(pressed=5) == "moving"
    hand.pilot.let_go("client 7")


def test_late_samples_do_nothing() -> None:
    hand = Hand()
    hand.says()
    hand.sequence = 0
    count = len(hand.jogs)
    assert hand.says(pressed=7) == "too late"
    assert len(hand.jogs) == count
