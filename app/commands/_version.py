"""Version of the program, as recordings and policies name what made them."""

import subprocess
from pathlib import Path

from app import __version__


def code_version() -> str:
    """The program's version with the commit it was started from, if known."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"]
    try:
        commit = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)  # noqa: S603 - fixed
    except (OSError, subprocess.SubprocessError):
        return __version__
    return f"{__version__}+{commit.stdout.strip()}"
