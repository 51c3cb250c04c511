"""Native libraries that must be loaded by hand before they can be imported."""

import ctypes
import functools
from types import ModuleType


@functools.cache
def load_open3d() -> ModuleType:
    """The module `open3d`."""
    load_libusb()
    import open3d

    return open3d


def load_libusb() -> None:
    """Load libusb with global symbols.

    Open3D and pyrealsense2 link against libusb-1.0.so.0, which a machine without root may lack; the package
    `libusb-package` brings a copy.
    """
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), ctypes.RTLD_GLOBAL)
