"""Intermediate results of perception, before there are particles, for the operator."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Bool

from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Seen(Message):
    """Segmentation of each camera's frame, and the colours it was made by.

    `masks`: by camera, thinned to about 320 pixels across; `pixels`: object pixels in the whole image; `points`: those
    of them with a depth inside the workspace box. Bounds as in `ColourRequest`. `apart_m`: median distance of each
    camera's object points from the other cameras'; empty where only one camera sees it. `cause` holds the frames' ids.
    """

    masks: Mapping[str, Bool[np.ndarray, "_ _"]]
    pixels: Mapping[str, int]
    points: Mapping[str, int]
    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]
    apart_m: Mapping[str, float] = field(default_factory=dict[str, float])
