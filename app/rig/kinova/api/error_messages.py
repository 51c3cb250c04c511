"""Texts of the arm's codes and faults, with the remedy where there is one.

Numbers: Kinovarobotics/ros_kortex, kortex_driver/protos (`Errors.proto`; `SafetyIdentifier` of `Base.proto` and
`InterconnectConfig.proto`, `SafetyIdentifierBankA` of `ActuatorConfig.proto`; `TrajectoryInfoType`,
`TrajectoryErrorType`).
"""

from collections.abc import Iterator, Mapping

SESSION_NOT_IN_CONTROL, ROBOT_IN_FAULT, ROBOT_IN_EMERGENCY_STOP = 130, 22, 25
SUB_ERRORS: Mapping[int, str] = {
    1: "it failed, and the arm says no more",
    2: "this firmware does not have it; update the firmware",
    3: "a number in it is invalid",
    4: "the arm does not know the service; is this a Gen3?",
    5: "the arm does not know the call; update the firmware",
    8: "the arm could not read the frame",
    12: "the session is not open any more; connect again",
    13: "the arm could not read the message",
    15: "the password is wrong",
    16: "there is no such user on the arm",
    17: "there is no such thing on the arm",
    18: "the arm is moving; wait for its end or stop it",
    19: "the arm is not moving",
    21: "the arm is still starting; wait until it is ready",
    ROBOT_IN_FAULT: "the arm is in fault; read the faults, remove their cause, then clear them",
    23: "the arm is in maintenance mode",
    24: "the arm is being updated",
    ROBOT_IN_EMERGENCY_STOP: "the emergency stop is in force; release it, then clear the faults",
    26: "the arm is in single-level servoing",
    27: "the arm is in low-level servoing; set it to single-level",
    48: "a number in it is above what the arm allows",
    49: "a number in it is below what the arm allows",
    50: "a part of the arm is not connected",
    53: "a safety threshold was reached",
    54: "this session may not do that; log in as a user who may",
    55: "it was stopped by hand, by another program, or by another command",
    56: "a pose is outside of what the arm reaches",
    57: "the number of joints is not that of the arm",
    58: "the duration is too short for the arm",
    59: "a speed is negative",
    60: "a speed is above the arm's limit",
    61: "an acceleration is above the arm's limit",
    65: "a joint would leave its range; approach from another side",
    68: "a trajectory is running already",
    70: "the trajectory cannot start here",
    75: "the arm is in another servoing mode; set it to single-level",
    108: "the connection is closed",
    SESSION_NOT_IN_CONTROL: "another session has control (a gamepad, the arm's web page, another program); end that",
    131: "the arm took too long",
    140: "the arm broke off the way between the waypoints",
    141: "the arm does not permit it now",
}
BASE_FAULTS: Mapping[int, str] = {
    0: "the firmware update failed",
    1: "there was an error in the communication with the outside",
    2: "the surroundings are too hot",
    3: "the processor is too hot",
    4: "a joint has a fault",
    5: "cyclic data came late",
    6: "the event log is full",
    7: "there are no kinematics for this arm",
    8: "the brakes could not be released",
    9: "the network failed",
    10: "a pose could not be reached",
    11: "the joints were not all found",
    12: "the network could not be started",
    13: "the current is too high",
    14: "the voltage is too high",
    15: "the voltage is too low",
    16: "the tool moved too fast",
    17: "the tool turned too fast",
    18: "the tool accelerated too much",
    19: "the tool's turning accelerated too much",
    20: "the force on the tool is too high",
    21: "the torque on the tool is too high",
    22: "the payload is too heavy",
    23: "the emergency stop was activated by a program",
    24: "the emergency stop line is active: release the button",
    25: "the inrush current limiter has a fault; switch the arm off and on",
    26: "stored settings are corrupt",
    27: "parts of the firmware do not belong together; update the firmware",
    28: "the self-test at power-on failed; switch the arm off and on",
    29: "a digital input is stuck",
    30: "the arm is in a position that it must not be in; move it out by its joints, slowly",
}
JOINT_FAULTS: Mapping[int, str] = {
    0: "does not follow its command; is something in the way?",
    1: "was too fast",
    2: "is at the upper end of its range",
    3: "is at the lower end of its range",
    4: "has strain gauges that disagree",
    5: "met too much torque; is something in the way?",
    6: "has no reliable position",
    7: "has a fault of its magnetic sensor",
    8: "has a fault of its Hall sensors",
    9: "has a wrong sequence of its Hall sensors",
    10: "has an encoder that disagrees with its Hall sensors",
    11: "has an encoder that lost its index",
    12: "has an encoder that disagrees with its magnetic sensor",
    13: "draws too much current",
    14: "draws another current than commanded",
    15: "has too high a voltage",
    16: "has too low a voltage",
    17: "has a motor that is too hot; let it cool down",
    18: "has electronics that are too hot; let them cool down",
    19: "has corrupt stored settings",
    20: "has a fault of its motor driver",
    21: "sees the emergency stop line",
    22: "missed messages of the base",
    23: "was restarted by its watchdog",
    24: "has an unreliable capacitive sensor",
    25: "has another gear ratio than expected",
    26: "has Hall and magnetic sensors that disagree",
    27: "has a fault of its brake driver",
    28: "moved too far while its brake was released",
}
WRIST_FAULTS: Mapping[int, str] = {
    0: "draws too much current",
    1: "has too high a voltage",
    2: "has too low a voltage",
    3: "has a motor that is too hot; let it cool down",
    4: "has electronics that are too hot; let them cool down",
    5: "has corrupt stored settings",
    6: "sees the emergency stop line",
    7: "missed messages of the base",
    8: "was restarted by its watchdog",
}
TRAJECTORY_INFO: Mapping[int, str] = {
    1: "a joint's acceleration reached its limit",
    2: "a joint's speed reached its limit",
    3: "a joint reached the end of its range",
    4: "a joint's torque reached its limit",
    5: "it came near a singular position, where the arm cannot move in every direction",
    6: "no joint angles were found for a pose",
    7: "the tool's acceleration reached its limit",
    8: "the tool's speed reached its limit",
    9: "the tool reached the end of where it may be",
    10: "the force at the tool reached its limit",
    11: "it would have entered a protection zone",
}
TRAJECTORY_ERRORS: Mapping[int, str] = {
    1: "is outside of what the arm reaches",
    2: "has another number of joints than the arm",
    3: "has an invalid duration",
    4: "is where the arm is already",
    5: "needs a joint speed above the limit",
    7: "needs a joint acceleration above the limit",
    8: "has an invalid time step",
    9: "makes the list too long",
    11: "needs a joint beyond its range",
    15: "comes while another trajectory is running",
    20: "has a position outside the limits",
    21: "has an orientation outside the limits",
    22: "has a speed outside the limits",
    23: "has a turning speed outside the limits",
    24: "needs a joint torque above the limit",
    25: "is of another kind than the others",
    26: "begins with a blend, but the first must not",
    27: "ends with a blend, but the last must stop",
    28: "has a blending radius that does not fit between its neighbours",
    29: "is given in a frame that the list cannot use",
    30: "makes the way numerically impossible",
}


def refusal(sub_code: int, said: str = "") -> str:
    """Reason of a refused call or aborted action, as a sentence without a beginning."""
    words = SUB_ERRORS.get(sub_code, f"for a reason of number {sub_code} that is not known here")
    return f"{words} ({said})." if said else f"{words}."


def bits(bank: int) -> Iterator[int]:
    """Set bits of a fault bank, the lowest first."""
    return (bit for bit in range(32) if bank >> bit & 1)


def faults(base: int, joints: tuple[int, ...], wrist: int) -> tuple[str, ...]:
    """Sentences on the faults in the banks; joints are counted from 1."""
    said = [f"{_fault_text(BASE_FAULTS, bit, 'the base has a fault')}" for bit in bits(base)]
    for number, bank in enumerate(joints, start=1):
        said += [f"joint {number} {_fault_text(JOINT_FAULTS, bit, 'has a fault')}" for bit in bits(bank)]
    said += [f"the wrist {_fault_text(WRIST_FAULTS, bit, 'has a fault')}" for bit in bits(wrist)]
    return tuple(f"{each[0].upper()}{each[1:]}{'' if each.endswith('?') else '.'}" for each in said)


def _fault_text(words: Mapping[int, str], bit: int, otherwise: str) -> str:
    return words.get(bit, f"{otherwise} of number {bit} that is not known here")
