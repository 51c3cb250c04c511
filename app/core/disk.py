"""Room on a disk."""

import shutil
from pathlib import Path


def free_bytes(folder: Path) -> int:
    """Free on the disk of `folder`; 0 where it is gone, so that nobody counts on it. May wait for a slow disk."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0
