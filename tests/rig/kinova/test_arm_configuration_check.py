"""An arm that is configured otherwise than this cell is not moved; one that is let go has the limits that it had."""

import re
from collections.abc import Iterator

import numpy as np
import pytest

from app.config import Limits, Site
from app.core.errors import DeviceError
from app.rig.kinova import arm_configuration_check
from app.rig.kinova.api.messages import Pose
from app.rig.kinova.api.setup import ToolConfiguration
from app.rig.kinova.arm import kinova_arm
from app.rig.kinova.arm_configuration_check import Holds
from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.control import KinovaControl, connect_arm
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.kortex import Kortex
from tests.rig.kinova.conftest import address, until

pytestmark = pytest.mark.serial

SITE = Site(limits=Limits(speed_m_s=0.25, angular_speed_rad_s=0.7))


@pytest.fixture
def other(arm: FakeProcess) -> Iterator[Kortex]:
    """Somebody else who looks at the arm."""
    other = Kortex(OwnLink(address(arm)))
    other.open()
    yield other
    arm.set(FaultInjection())
    other.close()


def held(arm: FakeProcess, holds: Holds | None = None) -> KinovaControl:
    return connect_arm(address(arm), SITE, holds=holds or Holds())


def tick(control: KinovaControl) -> bool:
    """Advance the control by a tick, as its process does; True if it is idle."""
    control.advance(0.01)
    return control.mode == "idle"


@pytest.mark.parametrize(
    ("adversity", "holds", "said"),
    [
        ({"tip_m": 0.0}, Holds(), "poses would be 120 mm and 0 degrees off"),
        ({}, Holds(tip_m=0.163), "(0.000, 0.000, 0.120) m, turned by (0, 0, 0) degrees, from its flange"),
        ({}, Holds(turn_deg=90.0), "0 mm and 90 degrees off. Set the tool in the arm's web page"),
        ({"tip_m": -0.12}, Holds(), "by tip_m and turn_deg of [arm.tool]"),
        ({}, Holds(mass_kg=1.4), "believes that 0.93 kg hang"),
        ({"payload_kg": 0.5}, Holds(mass_kg=0.925), "would be 5 N off"),
        ({"gravity_z": 9.81}, Holds(), "takes it to stand upright"),
        ({"gravity_z": 0.0}, Holds(), "set gravity in the arm's web page"),
        ({"denies": "GetToolConfiguration"}, Holds(), "refused GetToolConfiguration: this session may not do that"),
    ],
)
def test_an_arm_that_is_configured_otherwise_is_let_go_with_a_word_on_where_to_set_it(
    arm: FakeProcess, adversity: dict[str, object], holds: Holds, said: str
) -> None:
    arm.set(FaultInjection(**adversity))  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match=re.escape(said)):
        held(arm, holds)
    assert arm.look()["sessions"] == []
    arm.set(FaultInjection())


def test_a_tool_frame_of_numbers_that_are_none_is_said() -> None:
    with pytest.raises(DeviceError, match="numbers that are none"):
        arm_configuration_check._check_frame(ToolConfiguration(tool_transform=Pose(z=float("nan"))), Holds())


def test_an_arm_that_is_configured_for_what_it_holds_is_taken(arm: FakeProcess) -> None:
    arm.set(FaultInjection(tip_m=0.2635, turn_deg=-90.0, payload_kg=0.1))
    held(arm, Holds(tip_m=0.263, turn_deg=270.0, mass_kg=1.0)).close()
    arm.set(FaultInjection())


def test_the_limits_are_this_site_s_while_the_arm_is_held_and_what_they_were_after(
    arm: FakeProcess, other: Kortex
) -> None:
    other.limit(0.4, 1.5)
    before = other.limits()
    control = held(arm)
    assert len(other.limits()) == 3
    for said in other.limits().values():
        assert said == pytest.approx((SITE.limits.speed_m_s, np.degrees(SITE.limits.angular_speed_rad_s)), rel=1e-5)
    control.close()
    assert other.limits() == before


def test_the_limits_from_before_outlast_a_lost_connection(arm: FakeProcess, other: Kortex) -> None:
    before = other.limits()
    control = held(arm)
    arm.cut()
    until(lambda: not tick(control) and control.mode == "fault")
    until(lambda: not tick(control) and "is back" in control.reason)
    control.close()
    again = Kortex(OwnLink(address(arm)))
    again.open()
    assert again.limits() == before
    again.close()


@pytest.mark.parametrize("denied", ["SetTwistLinearSoftLimit", "SetTwistAngularSoftLimit", "GetKinematicSoftLimits"])
def test_an_arm_that_does_not_take_the_limits_is_not_moved(arm: FakeProcess, other: Kortex, denied: str) -> None:
    before = other.limits()
    arm.set(FaultInjection(denies=denied))
    with pytest.raises(DeviceError, match=f"does not take this site's limits as its own. The arm refused {denied}"):
        held(arm)
    arm.set(FaultInjection())
    assert other.limits() == before


@pytest.mark.anyio
async def test_what_is_wrong_is_a_sentence_where_the_arm_has_a_process_of_its_own(
    arm: FakeProcess, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(DeviceError, match="its error is above"):
        async with kinova_arm(address(arm), SITE, holds=Holds(tip_m=0.163)):
            pass
    said = capfd.readouterr().err
    assert "dipac arm: The arm's tool frame is" in said
    assert "Traceback" not in said
