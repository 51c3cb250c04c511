"""Site of the bench: a keep-out region for the arm, and short timings."""

from pathlib import Path
from typing import Final

from app.config import KeepOut, Limits, Site, Timing

KEPT_OUT: Final = KeepOut(name="the post", low=(0.60, -0.10, 0.0), high=(0.70, 0.10, 0.30))
"""Keep-out region that no stroke of the stand-in enters."""


def site(folder: Path) -> Site:
    """The limits and the watchdog are the ones that are shipped; the rest happens sooner."""
    soon = Timing(camera_period_s=0.25, camera_timeout_s=1.5, settle_s=0.2, health_period_s=0.1)
    return Site(recordings=folder, limits=Limits(keep_out=(KEPT_OUT,)), timing=soon)
