"""The simulated arm's injected errors: the tip's actual track for a commanded one."""

from collections.abc import Sequence
from typing import final

from app.core.geometry.track import Track
from app.rig.simulated.injected_effects.base import InjectedEffect


@final
class ErringArm:
    """An arm with injected effects; `late_s`: delay of its images after their stamps."""

    def __init__(self, hidden: Sequence[InjectedEffect]) -> None:
        self._driving = [each for each in hidden if each.effect.drive is not None]
        late = [each.effect.late_s(each.values) for each in hidden if each.effect.late_s is not None]
        self.late_s = sum(late, 0.0)

    @property
    def errs(self) -> bool:
        """True if its tip goes other ways, or at other times, than it is commanded."""
        return bool(self._driving)

    def goes(self, command: Track, *, told_only: bool) -> Track:
        """Actual track of the tip for a command, or the part of it that encoders measure."""
        track = command
        for each in self._driving:
            if each.effect.drive is not None and (each.effect.told or not told_only):
                track = each.effect.drive(track, each.values)
        return track
