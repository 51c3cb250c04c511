"""What perception makes of images before there are particles: for the operator's eyes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Bool

from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Seen(Message):
    """Which pixels of each camera's frame were taken for the object, and the colours that were looked for.

    `masks`: by camera, thinned to about 320 pixels across; `pixels`: how many of the whole image; `points`: how many of
    these have a depth within the box. Bounds as in `ColourRequest`. `cause` holds the frames' ids.
    """

    masks: Mapping[str, Bool[np.ndarray, "height width"]]
    pixels: Mapping[str, int]
    points: Mapping[str, int]
    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]
