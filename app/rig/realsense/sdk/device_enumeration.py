"""Enumeration of the RealSense cameras on the bus, and check of their USB speed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, final

from app.rig.realsense.sdk.sdk import Sdk


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Listed:
    """A camera on the bus: the SDK's device and its self-description. Fields that it does not report are empty."""

    device: Any
    name: str
    serial: str
    firmware: str
    usb: str


def find(sdk: Sdk) -> Sequence[Listed]:
    """Every camera that the SDK's context knows. One that is just leaving the bus may be left out."""
    cameras = list[Listed]()
    for device in sdk.context.query_devices():
        try:
            cameras.append(describe(sdk.rs, device))
        except RuntimeError:  # The SDK's error of a device that went away since.
            continue
    return cameras


def describe(rs: ModuleType, device: Any) -> Listed:
    """Description of `device` by itself."""
    info = rs.camera_info
    return Listed(
        device=device,
        name=_device_info(device, info.name),
        serial=_device_info(device, info.serial_number),
        firmware=_device_info(device, info.firmware_version),
        usb=_device_info(device, info.usb_type_descriptor),
    )


def census(sdk: Sdk) -> Mapping[str, Any]:
    """Report for the doctor, as JSON values: the SDK's version, and each camera with its warnings."""
    cameras = find(sdk)
    return {
        "version": str(sdk.rs.__version__),
        "connections": {each.serial: warning(each) for each in cameras},
        "cameras": [f"{each.name} {each.serial}, USB {each.usb or 'unknown'}" for each in cameras],
        "warnings": [said for each in cameras if (said := warning(each))],
    }


def is_slow(usb: str) -> bool:
    """True for a USB version, as the SDK writes it, older than 3; False where it is unknown."""
    return bool(usb) and usb[0] in "12"


def warning(listed: Listed) -> str:
    """Warning about a slow connection, with the remedy; empty for a fast one."""
    if not is_slow(listed.usb):
        return ""
    return (
        f"{listed.name} {listed.serial} is connected by USB {listed.usb}, which carries fewer and smaller images; use "
        "a USB 3 port and a cable made for it."
    )


def _device_info(device: Any, what: Any) -> str:
    return str(device.get_info(what)) if device.supports(what) else ""
