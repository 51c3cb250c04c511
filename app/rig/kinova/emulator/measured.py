"""Feedback message of the emulated arm."""

import numpy as np

from app.rig.kinova import gen3
from app.rig.kinova.api.feedback import (
    ActuatorFeedback,
    BaseFeedback,
    Feedback,
    GripperFeedback,
    InterconnectFeedback,
    MotorFeedback,
)
from app.rig.kinova.emulator.arm import FakeArm


def feedback(arm: FakeArm) -> Feedback:
    """The whole feedback message; joints as the arm reports them, 0 to 360 degrees."""
    return Feedback(base=_base(arm), actuators=_actuators(arm), interconnect=_interconnect(arm))


def _base(arm: FakeArm) -> BaseFeedback:
    links = gen3.frames(arm.joints)
    pose, twist = gen3.pose(links[7]), gen3.jacobian(links) @ arm.velocity
    linear, angular = [float(each) for each in twist[:3]], [float(each) for each in np.degrees(twist[3:])]
    return BaseFeedback(
        active_state_connection_identifier=arm.mover,
        active_state=arm.state,
        arm_voltage=24.0,
        tool_pose_x=pose.x,
        tool_pose_y=pose.y,
        tool_pose_z=pose.z,
        tool_pose_theta_x=pose.theta_x,
        tool_pose_theta_y=pose.theta_y,
        tool_pose_theta_z=pose.theta_z,
        tool_twist_linear_x=linear[0],
        tool_twist_linear_y=linear[1],
        tool_twist_linear_z=linear[2],
        tool_twist_angular_x=angular[0],
        tool_twist_angular_y=angular[1],
        tool_twist_angular_z=angular[2],
        tool_external_wrench_force_z=arm.adversity.force_n,
        fault_bank_a=arm.base_faults,
    )


def _actuators(arm: FakeArm) -> tuple[ActuatorFeedback, ...]:
    angles, speeds = np.degrees(arm.joints) % 360.0, np.degrees(arm.velocity)
    return tuple(
        ActuatorFeedback(
            position=float(angle), velocity=float(speed), voltage=24.0, temperature_motor=35.0, fault_bank_a=bank
        )
        for angle, speed, bank in zip(angles, speeds, arm.joint_faults, strict=True)
    )


def _interconnect(arm: FakeArm) -> InterconnectFeedback:
    motor = MotorFeedback(position=100.0 * arm.fingers.position, current_motor=arm.fingers.current_ma)
    return InterconnectFeedback(gripper_feedback=GripperFeedback(motor=(motor,)))
