"""Passive probe of an arm: nothing is set, and nothing moves."""

import time
from dataclasses import replace
from typing import Final

from app.config import Limits
from app.core.errors import DeviceError
from app.rig.kinova.api.errors import NoAnswer
from app.rig.kinova.arm_configuration_check import Holds, check
from app.rig.kinova.client.clients import link_by
from app.rig.kinova.client.link import Address
from app.rig.kinova.feedback_conversion import ArmFeedback, feedback_of
from app.rig.kinova.kortex import Kortex

_TRIES: Final = 10
_PATIENT_S: Final = 2.0
"""Session timeout [s]: the session commands no motion, so a lost one is harmless."""


def look_at(address: Address, client: str, holds: Holds) -> str:
    """Description of the arm at `address` by its own reports.

    Raises DeviceError, which gives the remedy, where none answers, it is not configured for what it `holds`, or it is
    in fault; UsageError where there is no such client, and PreflightError where that is not installed.
    """
    kortex = Kortex(link_by(replace(address, stops_after_s=_PATIENT_S), client))
    try:
        kortex.open()
        check(kortex, holds)
        return _describe_arm(kortex)
    finally:
        kortex.close()


def _describe_arm(kortex: Kortex) -> str:
    firmware, joints = kortex.firmware(), kortex.joint_count()
    if joints != 7:
        raise DeviceError(f"The arm there has {joints} joints; a Gen3 of 7 is needed.")
    state = _state(kortex)
    if state.faults:
        raise DeviceError(f"The arm is in fault: {' '.join(state.faults)} Remove the cause; the console clears it.")
    if not state.ready:
        raise DeviceError("The arm starts, is serviced, or is commanded at low level; have that end.")
    return f"Gen3 with {joints} joints, firmware {firmware}, {'at rest' if state.still else 'moving'}"


def _state(kortex: Kortex) -> ArmFeedback:
    """First valid feedback of several: a datagram may be lost, and a number may be NaN for a moment."""
    for _ in range(_TRIES):
        try:
            found = feedback_of(kortex.feedback(), time.monotonic(), Limits().opening_m)
        except NoAnswer:
            continue
        if found is not None:
            return found
    raise DeviceError("The arm does not say over UDP where it is; open port 10001 on the way to it, then try again.")
