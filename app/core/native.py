"""Native libraries that need a hand before they can be imported."""

import ctypes
from types import ModuleType


def load_open3d() -> ModuleType:
    """The module `open3d`.

    Open3D (and pyrealsense2) link against libusb-1.0.so.0, which a machine without root may lack; the copy that the
    package `libusb-package` brings is loaded first, for all to see.
    """
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), ctypes.RTLD_GLOBAL)
    import open3d

    return open3d
