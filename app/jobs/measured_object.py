"""Sizes and colours of an object from what cameras show of it: a rope, loose pieces, or a cloth that lies flat."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple, final

import cv2
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from threadpoolctl import threadpool_limits

from app.core.colours import ColourRange
from app.core.dialogue.object_messages import MeasuredSize
from app.core.errors import PerceptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxtyping import Float64

    from app.core.geometry.object_description import ObjectType
    from app.core.geometry.shapes.base import Colour
    from app.core.types import Cloud, ColourImage
    from app.perception.mask.segment import Segmenter

_FEWEST: Final = 30
"""Points of a cloud that say how large a thing is."""
_MEDIAN_TO_SD: Final = 1.4826
_APART_STEPS: Final = 1.8
"""Distance, in those of neighbouring points, from which on points are of two pieces."""
_ALONE: Final = 1.5
"""A cluster up to so many times as long as a short one is one piece."""
_SHORT: Final = 0.25
"""Share of the clusters that are shorter than a short one."""
_GUESSED: Final = 0.3
"""Standard deviation of the number of pieces in a cluster of several, for each of them."""
_EDGES_M: Final = 6e-3
_ACROSS_M: Final = 5e-4
"""Errors of the lengths and radii that images show: depth is blurred at edges. Measured in the simulated cell, where
ropes of 25, 40 and 60 cm seem 2 to 6 mm too long, and radii of 5, 8 and 10 mm 0.4 to 0.7 mm too small."""
_PIECE_M: Final = 1.5e-3
_SIDE_M: Final = 4e-3
"""The same of pieces and sheets: beans of 10 mm seem 12 mm wide, cloths of 20 and 25 cm 5 mm too large."""
_MOST_CLOUDS: Final = 5
_FEWEST_PIXELS: Final = 100
_HUE_MARGIN_DEG: Final = 8.0
_MARGIN: Final = 0.08
"""Margins around the colours that were seen: light changes."""
_RANGE: Final = (2.0, 98.0)
"""Percentiles that are about the range of nearly all pixels."""


@final
class Measurement(NamedTuple):
    """Sizes, each with its standard deviation, and sentences on what is not measured."""

    sizes: tuple[MeasuredSize, ...]
    notes: tuple[str, ...] = ()


@threadpool_limits.wrap(limits=1, user_api="blas")
def measure_object(kind: ObjectType, surfaces: Sequence[Cloud]) -> Measurement:
    """The size of the object of which these are surfaces [m], as cameras see them, above the table z = 0.

    Raises PerceptionError where they show too little of it.
    """
    usable = [cloud for cloud in surfaces if len(cloud) >= _FEWEST][-_MOST_CLOUDS:]
    if kind == "liquid":
        return Measurement((), ("Volume and density of a liquid are not seen: measure them.",))
    if not usable:
        raise PerceptionError("Too little of the object is seen to say how large it is; look at the masks.")
    match kind:
        case "rope":
            return _rope(usable)
        case "beans":
            return _pieces(usable)
        case "cloth":
            return _sheet(usable)


def _rope(surfaces: Sequence[Cloud]) -> Measurement:
    from app.sim.rods.geometry.rope_size import rope_size

    found = rope_size(surfaces)
    sizes = (
        MeasuredSize(name="length_m", value=found.length_m, sd=float(np.hypot(found.length_sd_m, _EDGES_M))),
        MeasuredSize(name="radius_m", value=found.radius_m, sd=float(np.hypot(found.radius_sd_m, _ACROSS_M))),
    )
    return Measurement(sizes, ("Its mass is not seen: weigh it.",))


def _pieces(surfaces: Sequence[Cloud]) -> Measurement:
    """Number of pieces and their extent. Touching ones are told by how much of the table they cover."""
    counts, lengths, widths, guesses = list[float](), list[float](), list[float](), list[float]()
    for cloud in surfaces:
        clusters = _clusters(cloud)
        extents = np.array([_extent(cluster) for cluster in clusters])
        alone = extents[:, 0] <= _ALONE * np.quantile(extents[:, 0], _SHORT)
        points = np.array([len(cluster) for cluster in clusters])
        many = np.where(alone, 1.0, np.maximum(np.round(points / np.median(points[alone])), 2.0))
        counts.append(float(many.sum()))
        guesses.append(_GUESSED * float(many[~alone].sum()) ** 0.5)
        lengths.append(float(np.median(extents[alone, 0])))
        widths.append(float(np.median(extents[alone, 1])))
    count, count_sd = _median(counts, least_sd=float(np.median(guesses)))
    length, length_sd = _median(lengths, least_sd=_PIECE_M)
    width, width_sd = _median(widths, least_sd=_PIECE_M)
    sizes = (
        MeasuredSize(name="count", value=float(round(count)), sd=count_sd),
        MeasuredSize(name="piece_length_m", value=length, sd=length_sd),
        MeasuredSize(name="piece_width_m", value=width, sd=width_sd),
    )
    return Measurement(sizes, ("Their mass is not seen: weigh all together.",))


def _sheet(surfaces: Sequence[Cloud]) -> Measurement:
    """Sides of the smallest rectangle about the points; of a square cloth, the mean of both."""
    sides = list[tuple[float, float]]()
    for cloud in surfaces:
        flat = np.asarray(cloud[:, :2], np.float32)
        short, long = sorted(cv2.minAreaRect(1e3 * flat)[1])
        step_m = _step_m(flat)
        sides.append((1e-3 * short + step_m, 1e-3 * long + step_m))
    short, long = (_median([each[side] for each in sides], least_sd=_SIDE_M) for side in (0, 1))
    mean_m, uneven_m = (short[0] + long[0]) / 2, (long[0] - short[0]) / 2
    size = MeasuredSize(name="size_m", value=mean_m, sd=float(np.hypot(max(short[1], long[1]), uneven_m)))
    notes = ["Its mass is not seen: weigh it."]
    if uneven_m > 0.1 * mean_m:
        notes.append(
            f"Its sides seem {1e3 * short[0]:.0f} and {1e3 * long[0]:.0f} mm long: lay it flat, or it is no square."
        )
    return Measurement((size,), tuple(notes))


def _clusters(cloud: Cloud) -> list[Cloud]:
    """Points that hang together, seen from above."""
    flat = cloud[:, :2].astype(np.float64)
    pairs = KDTree(flat).query_pairs(_APART_STEPS * _step_m(flat), output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(flat), len(flat)))
    number, label = connected_components(links, directed=False)
    return [cloud[label == each] for each in range(number) if (label == each).sum() >= 3]


def _step_m(flat: np.ndarray) -> float:
    """Usual distance of a point from its nearest neighbours."""
    near = KDTree(flat).query(flat, k=3)[0][:, 2]
    return float(np.median(near))


def _extent(cluster: Cloud) -> Float64[np.ndarray, 2]:
    """Length and width of the points, seen from above, with half a step at either end."""
    flat = cluster[:, :2].astype(np.float64)
    step_m = _step_m(flat) if len(flat) > 3 else 0.0
    short, long = sorted(cv2.minAreaRect((1e3 * flat).astype(np.float32))[1])
    return np.array([1e-3 * long, 1e-3 * short]) + step_m


def _median(values: Sequence[float], *, least_sd: float) -> tuple[float, float]:
    """Median and the standard deviation of one value, by their spread."""
    middle = float(np.median(values))
    spread = _MEDIAN_TO_SD * float(np.median(np.abs(np.array(values) - middle)))
    return middle, max(spread, least_sd)


def measure_colours(images: Sequence[ColourImage], segmenter: Segmenter) -> tuple[Colour, ColourRange] | None:
    """Median colour of the object's pixels, and the range of nearly all; None where they are too few."""
    pixels = np.concatenate([image[segmenter.masks(image)[0]] for image in images] or [np.zeros((0, 3), np.uint8)])
    if len(pixels) < _FEWEST_PIXELS:
        return None
    red, green, blue = (np.median(pixels, axis=0) / 255).tolist()
    hsv = cv2.cvtColor(pixels[None].astype(np.float32) / 255, cv2.COLOR_RGB2HSV)[0].astype(np.float64)
    turned = np.radians(hsv[:, 0])
    middle = np.degrees(np.arctan2(np.sin(turned).mean(), np.cos(turned).mean()))
    beside = (hsv[:, 0] - middle + 180) % 360 - 180
    low, high = np.percentile(beside, _RANGE) + np.array([-_HUE_MARGIN_DEG, _HUE_MARGIN_DEG])
    saturation, value = (float(np.percentile(hsv[:, axis], _RANGE[0])) for axis in (1, 2))
    found = ColourRange.of(
        (float(round((middle + low) % 360, 1)), float(round((middle + high) % 360, 1))),
        (round(max(saturation - _MARGIN, 0.05), 3), 1.0),
        (round(max(value - _MARGIN, 0.05), 3), 1.0),
    )
    return (red, green, blue), found
