"""Free space on a disk."""

import shutil
from pathlib import Path


def free_bytes(folder: Path) -> int:
    """Free bytes on the disk of `folder`; 0 where the folder is gone. May block on a slow disk."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0
