"""What perception makes of images before there are particles: for the operator's eyes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Bool

from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Seen(Message):
    """Which pixels of each camera's frame were taken for the object, and the colours that were looked for.

    `masks`: by camera, thinned to about 320 pixels across; `pixels`: how many of the whole image; `points`: how many of
    these have a depth within the box. Bounds as in `ColourRequest`. `apart_m`: how far each camera's points of the
    object are from the others', by the median; none where only one camera sees it. `cause` holds the frames' ids.
    """

    masks: Mapping[str, Bool[np.ndarray, "_ _"]]
    pixels: Mapping[str, int]
    points: Mapping[str, int]
    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]
    apart_m: Mapping[str, float] = field(default_factory=dict[str, float])
