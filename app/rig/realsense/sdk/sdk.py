"""The RealSense SDK, loaded on first use: importing it takes a while, and most sessions do without."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any, Self, final

from app.core.system.shared_libraries import load_libusb


def load_realsense() -> ModuleType:
    """The module `pyrealsense2`."""
    load_libusb()
    import pyrealsense2

    return pyrealsense2


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Sdk:
    """The module and a context of it, which knows the cameras on the bus."""

    rs: ModuleType
    context: Any

    @classmethod
    def load(cls) -> Self:
        """The SDK with a context of its own."""
        rs = load_realsense()
        return cls(rs=rs, context=rs.context())


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """A pipeline that is about to be started with `config`."""

    sdk: Sdk
    pipeline: Any
    config: Any

    @classmethod
    def of(cls, sdk: Sdk) -> Self:
        """A pipeline whose camera is still to be selected."""
        return cls(sdk=sdk, pipeline=sdk.rs.pipeline(sdk.context), config=sdk.rs.config())
