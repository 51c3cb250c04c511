"""Data set of discovery: pushes in episodes, with the clouds before, during and after each.

Lengths in metres in the base frame, times in seconds on one clock.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.track import Track
from app.core.measured_setup import MeasuredSetup
from app.core.messages import Parameter
from app.core.types import Cloud, Points


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectionView:
    """The object as particles at one moment; with the finger's points in the same images, where there are any."""

    time_s: float
    points: Points
    finger: Cloud | None = None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Push:
    """One motion of the tool: observations before, during and after it, commanded and measured tracks."""

    episode: int
    before: ProjectionView
    during: tuple[ProjectionView, ...]
    after: ProjectionView
    command: Track
    measured: Track | None

    @property
    def track(self) -> Track:
        """The tool as measured, or else as commanded."""
        return self.measured or self.command


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """All pushes in the order in which they were made. Every view has the same number of points.

    `tables`: points of the bare table by episode. `camera`: where the cameras are, in the middle.
    """

    task: str
    pushes: tuple[Push, ...]
    tables: Mapping[int, Cloud] = field(default_factory=dict[int, Cloud])
    camera: tuple[float, float, float] = (0.55, 0.0, 0.9)
    setup: MeasuredSetup | None = None
    """Object, tool and table of imported data; None of recordings of this program, which are the task's."""
    priors: tuple[Parameter, ...] = ()
    """Intervals of the object's parameters that are known beforehand."""
    origin_m: tuple[float, float] = (0.0, 0.0)
    """Origin of its frame in that of the data: see `discovery.checks.placement`."""

    def session_times(self) -> Float64[np.ndarray, " K"]:
        """Session time of each push: -0.5 the first, 0.5 the last."""
        times = np.array([push.before.time_s for push in self.pushes])
        spread = times.max() - times.min()
        return (times - times.min()) / spread - 0.5 if spread > 0 else np.zeros(len(times))
