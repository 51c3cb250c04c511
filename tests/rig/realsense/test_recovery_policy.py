"""The ladder, rung by rung, on a clock of its own: what is done next follows from what is seen alone."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.rig.realsense.recovery_policy import Action, CaptureStatus, Ladder, Phase, RecoveryTimeouts, Step, climb

PATIENCE = RecoveryTimeouts()
ABSENT = "there is no such camera"


class Camera:
    """A camera and its process as the ladder sees them; `told` is what the ladder asked for, with when."""

    def __init__(self) -> None:
        self.now_s, self.image_s, self.pulse_s = 100.0, -math.inf, 100.0
        self.step: Step = "opening"
        self.failure, self.absent, self.death, self.hangs = "", False, "", False
        self.told: list[tuple[float, Action]] = []
        self.ladder = Ladder.at_start(self.now_s)

    def see(self) -> Action | None:
        if not self.hangs:
            self.pulse_s = self.now_s
        sight = CaptureStatus(
            now_s=self.now_s,
            pulse_s=self.pulse_s,
            image_s=self.image_s,
            step=self.step,
            failure=self.failure,
            absent=self.absent,
            death=self.death,
        )
        self.ladder, action = climb(self.ladder, sight, PATIENCE)
        if action is not None:
            self.told.append((self.now_s, action))
            self.step, self.failure, self.absent, self.death = "opening", "", False, ""
            if action == "replace":
                self.hangs, self.pulse_s = False, self.now_s
        return action

    def wait(self, duration_s: float, *, images: bool = False) -> list[Action]:
        """Look twenty times a second; what was asked for meanwhile."""
        told = len(self.told)
        for _ in range(round(duration_s * 20)):
            self.now_s += 0.05
            if images:
                self.step, self.image_s = "streaming", self.now_s
            self.see()
        return [action for _, action in self.told[told:]]

    def fail(self, why: str = "it failed", *, absent: bool = False) -> Action | None:
        self.now_s += 0.05
        self.step, self.failure, self.absent = "failed", why, absent
        return self.see()

    @property
    def phase(self) -> Phase:
        return self.ladder.phase

    @property
    def words(self) -> str:
        return self.ladder.words(self.now_s)


@pytest.fixture
def camera() -> Camera:
    """A camera that streams."""
    camera = Camera()
    assert camera.wait(3, images=True) == []
    assert (camera.phase, camera.words) == ("streaming", "")
    return camera


def test_a_stream_that_stands_still_is_started_anew_and_nothing_more_when_images_come_again(camera: Camera) -> None:
    assert camera.wait(PATIENCE.late_s - 0.1) == []
    assert camera.wait(0.2) == ["open"]
    assert camera.words == "no image for 1 s (the stream stands still): the stream is started anew"
    camera.wait(0.5)
    assert camera.wait(20, images=True) == []
    assert camera.phase == "streaming"


def test_a_stream_that_fails_is_started_anew_at_once(camera: Camera) -> None:
    assert camera.fail("the cable came loose") == "open"
    assert "(the cable came loose)" in camera.words


def test_what_starting_anew_does_not_mend_is_reset(camera: Camera) -> None:
    camera.wait(PATIENCE.late_s + 0.1)
    assert camera.wait(PATIENCE.open_s + 0.1) == ["reset"]
    assert "no image came within 15 s): the camera is reset" in camera.words
    assert camera.wait(PATIENCE.reset_s - 0.5) == []
    camera.wait(0.1, images=True)
    assert camera.phase == "streaming"


def test_after_a_reset_in_vain_each_further_try_waits_longer_up_to_a_limit(camera: Camera) -> None:
    camera.fail()
    while len(camera.told) < 30:
        camera.fail() or camera.wait(0.05)
        while camera.phase == "waiting" and not camera.wait(0.05):
            pass
    assert [action for _, action in camera.told[:5]] == ["open", "reset", "open", "reset", "open"]
    opened_s = [when_s for when_s, action in camera.told if action == "open"]
    waits_s = [later - earlier for earlier, later in pairwise(opened_s)]
    assert all(later > earlier - 0.2 for earlier, later in pairwise(waits_s))
    assert waits_s[0] < 4 * PATIENCE.back_off_s
    assert waits_s[-1] == pytest.approx(PATIENCE.longest_back_off_s, abs=0.3)


def test_while_it_waits_it_says_why_and_for_how_long(camera: Camera) -> None:
    camera.fail("busy")
    camera.fail("busy still")
    camera.fail("busy again")
    assert camera.phase == "waiting"
    assert camera.words == "no image for 0 s (busy again): tried again in 2 s"


def test_a_camera_that_was_unplugged_is_looked_for_until_it_is_back_and_never_reset(camera: Camera) -> None:
    camera.fail("unplugged")
    for _ in range(100):
        assert camera.fail(ABSENT, absent=True) is None
        assert camera.wait(PATIENCE.absent_s + 0.1) == ["open"]
    assert ABSENT in camera.words
    assert camera.wait(0.1, images=True) == []
    assert camera.phase == "streaming"
    assert camera.ladder.failures == 0


def test_a_camera_that_never_gave_an_image_is_not_reset_for_another_program_may_use_it() -> None:
    camera = Camera()
    for _ in range(6):
        camera.fail("busy")
        camera.wait(PATIENCE.longest_back_off_s + 0.1)
    assert {action for _, action in camera.told} == {"open"}


def test_a_first_process_that_opens_nothing_in_time_is_told_again() -> None:
    camera = Camera()
    assert camera.wait(PATIENCE.open_s) == []
    assert camera.wait(PATIENCE.back_off_s + 0.2) == ["open"]


@pytest.mark.parametrize("step", ["opening", "streaming", "closing", "resetting", "failed", "asked"])
def test_a_process_that_hangs_is_replaced_whatever_it_was_doing(camera: Camera, step: Step) -> None:
    camera.step, camera.hangs = step, True
    slow = {"closing": PATIENCE.close_s, "opening": PATIENCE.slow_s, "resetting": PATIENCE.slow_s}
    limit_s = slow.get(step, PATIENCE.quiet_s)
    camera.image_s = camera.now_s + limit_s if step == "streaming" else camera.image_s
    camera.ladder = replace(camera.ladder, phase="streaming" if step == "streaming" else "resetting")
    camera.ladder = replace(camera.ladder, since_s=camera.now_s)
    if step == "failed":
        camera.ladder = replace(camera.ladder, phase="waiting", until_s=math.inf)
    assert camera.wait(limit_s - 0.1) == []
    assert camera.wait(0.3) == ["replace"]
    assert "said nothing for" in camera.words
    assert camera.words.endswith("the camera is being opened by a new process")


def test_a_process_that_ended_is_replaced_at_once_and_others_later_and_later(camera: Camera) -> None:
    for _ in range(5):
        camera.now_s += 0.05
        camera.death = "its process ended with code -11"
        camera.see()
        while camera.phase == "replacing":
            assert "a new process starts in" in camera.words
            camera.wait(0.05)
    times_s = [when_s for when_s, action in camera.told if action == "replace"]
    waits_s = [round(later - earlier) for earlier, later in pairwise(times_s)]
    assert waits_s == [1, 2, 4, 8]
    assert "code -11" in camera.words


def test_failures_are_forgotten_after_images_for_a_while_and_not_before(camera: Camera) -> None:
    camera.fail()
    camera.fail()
    assert camera.ladder.failures == 1
    camera.wait(PATIENCE.steady_s - 1, images=True)
    assert camera.ladder.failures == 1
    camera.wait(2, images=True)
    assert camera.ladder.failures == 0


def test_a_recording_at_its_end_is_left_in_peace(camera: Camera) -> None:
    camera.step, camera.failure = "ended", "the recording has been played"
    assert camera.wait(60) == []
    assert camera.words == "at its end: the recording has been played"


STEPS = st.sampled_from(["asked", "opening", "streaming", "closing", "resetting", "failed"])


@given(st.lists(st.tuples(STEPS, st.booleans(), st.booleans(), st.booleans(), st.floats(0.05, 30)), max_size=40))
def test_whatever_happened_a_camera_that_is_well_again_streams_within_its_longest_wait(happened) -> None:
    camera = Camera()
    for step, absent, hangs, dies, duration_s in happened:
        camera.step, camera.hangs = step, hangs
        camera.failure, camera.absent = ("why", absent) if step == "failed" else ("", False)
        camera.death = "dead" if dies else ""
        camera.now_s += duration_s
        camera.see()
    camera.hangs, camera.death = False, ""
    longest_s = PATIENCE.longest_back_off_s + PATIENCE.reset_s + PATIENCE.slow_s
    end_s = camera.now_s + longest_s
    while camera.phase != "streaming" and camera.now_s < end_s:
        camera.wait(0.05, images=camera.phase in ("starting", "opening", "resetting"))
    assert camera.phase == "streaming"
    assert camera.wait(5, images=True) == []
