"""Messages of the arm's setup: its product, its tool, its soft limits, and its protection zones.

Field numbers: Kinovarobotics/ros_kortex, kortex_driver/protos (`Base.proto`, `ControlConfig.proto`,
`ProductConfiguration.proto`).
"""

from dataclasses import dataclass
from typing import Annotated, final

from app.rig.kinova.api.messages import Pose
from app.rig.kinova.api.protobuf import Field
from app.rig.kinova.api.session import Handle


@final
@dataclass(frozen=True, kw_only=True)
class Point:
    """A point [m]."""

    x: Annotated[float, Field(1, "float")] = 0.0
    y: Annotated[float, Field(2, "float")] = 0.0
    z: Annotated[float, Field(3, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class RotationMatrixRow:
    """Row of a rotation matrix."""

    column1: Annotated[float, Field(1, "float")] = 0.0
    column2: Annotated[float, Field(2, "float")] = 0.0
    column3: Annotated[float, Field(3, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class RotationMatrix:
    """Rotation matrix as three rows."""

    row1: Annotated[RotationMatrixRow | None, Field(1, "message")] = None
    row2: Annotated[RotationMatrixRow | None, Field(2, "message")] = None
    row3: Annotated[RotationMatrixRow | None, Field(3, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ZoneShape:
    """Shape and pose of a protection zone; a prism is centred on its origin."""

    shape_type: Annotated[int, Field(1, "uint32")] = 0
    origin: Annotated[Point | None, Field(2, "message")] = None
    orientation: Annotated[RotationMatrix | None, Field(3, "message")] = None
    dimensions: Annotated[tuple[float, ...], Field(4, "float")] = ()
    envelope_thickness: Annotated[float, Field(5, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class ProtectionZone:
    """A region that Cartesian motions may not enter; joint motions may."""

    handle: Annotated[Handle | None, Field(1, "message")] = None
    name: Annotated[str, Field(2, "string")] = ""
    is_enabled: Annotated[bool, Field(4, "bool")] = False
    shape: Annotated[ZoneShape | None, Field(5, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ProtectionZoneList:
    """All zones of the arm."""

    protection_zones: Annotated[tuple[ProtectionZone, ...], Field(1, "message")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class ProtectionZoneNotification:
    """Notification of a zone reached (1), entered (2) or left (3)."""

    event: Annotated[int, Field(1, "uint32")] = 0
    handle: Annotated[Handle | None, Field(2, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class ActuatorInformation:
    """Number of joints."""

    count: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class FirmwareVersions:
    """Version of the firmware bundle."""

    main_bundle_version: Annotated[str, Field(1, "string")] = ""


@final
@dataclass(frozen=True, kw_only=True)
class ProductConfiguration:
    """Product of the arm."""

    kin: Annotated[str, Field(1, "string")] = ""
    model: Annotated[int, Field(2, "uint32")] = 0
    degree_of_freedom: Annotated[int, Field(6, "uint32")] = 0
    end_effector_type: Annotated[int, Field(8, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class TwistLinearSoftLimit:
    """Soft limit of the linear speed [m/s] in a `ControlMode`."""

    control_mode: Annotated[int, Field(1, "uint32")] = 0
    twist_linear_soft_limit: Annotated[float, Field(2, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class TwistAngularSoftLimit:
    """Soft limit of the angular speed [degrees/s] in a `ControlMode`."""

    control_mode: Annotated[int, Field(1, "uint32")] = 0
    twist_angular_soft_limit: Annotated[float, Field(2, "float")] = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class KinematicLimits:
    """Limits of speeds and accelerations [m/s, degrees/s, degrees/s^2]."""

    control_mode: Annotated[int, Field(1, "uint32")] = 0
    twist_linear: Annotated[float, Field(2, "float")] = 0.0
    twist_angular: Annotated[float, Field(3, "float")] = 0.0
    joint_speed_limits: Annotated[tuple[float, ...], Field(4, "float")] = ()
    joint_acceleration_limits: Annotated[tuple[float, ...], Field(5, "float")] = ()


@final
@dataclass(frozen=True, kw_only=True)
class ControlModeInformation:
    """A `ControlMode`."""

    control_mode: Annotated[int, Field(1, "uint32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class ToolConfiguration:
    """Pose of the tool's frame in that of the flange, and the tool's mass [kg], without payload."""

    tool_transform: Annotated[Pose | None, Field(1, "message")] = None
    tool_mass: Annotated[float, Field(2, "float")] = 0.0
    tool_mass_center: Annotated[Point | None, Field(3, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class PayloadInformation:
    """Mass of the payload [kg]."""

    payload_mass: Annotated[float, Field(1, "float")] = 0.0
    payload_mass_center: Annotated[Point | None, Field(2, "message")] = None


@final
@dataclass(frozen=True, kw_only=True)
class GravityVector:
    """Gravity [m/s^2] in the base's frame: straight down where the arm stands upright."""

    x: Annotated[float, Field(1, "float")] = 0.0
    y: Annotated[float, Field(2, "float")] = 0.0
    z: Annotated[float, Field(3, "float")] = 0.0
