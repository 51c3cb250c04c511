"""Stream settings of a camera: size and rate of its images, and filters of its depth."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, kw_only=True)
class Filters:
    """The SDK's depth filters, each off unless asked for. None fills holes: that would invent surface.

    `near_m`, `far_m`: depth outside is dropped. `spatial`: edge-preserving smoothing within an image. `temporal`:
    smoothing over images, which blurs moving objects; its memory of a pixel does not replace a missing reading.
    """

    near_m: float | None = None
    far_m: float | None = None
    spatial: bool = False
    temporal: bool = False


@final
@dataclass(frozen=True, kw_only=True)
class StreamSettings:
    """Stream of a camera. Colour and depth have the same size and rate; `warm_up` images are dropped at each start.

    A camera of the D400 kind needs 10 to 20 images until its automatic exposure has settled.
    """

    width: int = 640
    height: int = 480
    rate_hz: int = 30
    warm_up: int = 15
    filters: Filters = Filters()

    @property
    def period_s(self) -> float:
        """Time between images [s]."""
        return 1.0 / self.rate_hz
