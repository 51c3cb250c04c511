"""The colour mask: what it finds whatever the light, and what it leaves."""

import colorsys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.colours import ColourRange, colour_mask
from app.core.errors import ParameterError


def patch(hue_deg: float, saturation: float = 0.8, value: float = 0.8) -> np.ndarray:
    """A 9 x 9 image of one colour."""
    rgb = np.array(colorsys.hsv_to_rgb(hue_deg / 360 % 1.0, saturation, value))
    return np.broadcast_to(np.rint(255 * rgb), (9, 9, 3)).astype(np.uint8)


@given(hue=st.floats(0, 360), saturation=st.floats(0.5, 1.0), shade=st.floats(0.35, 1.0))
def test_a_range_around_a_colour_finds_it_lit_and_in_shade(hue, saturation, shade):
    colour = colorsys.hsv_to_rgb(hue / 360, saturation, 0.9)
    assert colour_mask(patch(hue, saturation, 0.9 * shade), ColourRange.around(colour)).all()


@given(hue=st.floats(0, 360), away=st.floats(25, 335))
def test_it_does_not_find_another_hue(hue, away):
    colour = colorsys.hsv_to_rgb(hue / 360, 0.8, 0.8)
    assert not colour_mask(patch(hue + away), ColourRange.around(colour)).any()


@pytest.mark.parametrize(("hue", "found"), [(345, True), (358, True), (2, True), (15, True), (40, False), (320, False)])
def test_a_range_may_pass_through_red(hue, found):
    assert colour_mask(patch(hue), ColourRange(hue_low_deg=340.0, hue_high_deg=20.0)).all() == found


def test_grey_belongs_to_no_hue():
    assert not colour_mask(patch(20, saturation=0.1), ColourRange(hue_low_deg=0.0, hue_high_deg=360.0)).any()


@given(seed=st.integers(0, 2**32 - 1))
def test_a_mirrored_image_has_the_mirrored_mask(seed):
    wanted = ColourRange(hue_low_deg=300.0, hue_high_deg=60.0, saturation_low=0.2)
    image = np.random.default_rng(seed).integers(0, 256, (12, 17, 3), dtype=np.uint8)
    mirrored = colour_mask(np.ascontiguousarray(image[:, ::-1]), wanted)
    np.testing.assert_array_equal(mirrored, colour_mask(image, wanted)[:, ::-1])


def test_single_pixels_of_the_colour_are_noise_and_single_pixels_of_another_are_not_holes():
    wanted = ColourRange(hue_low_deg=0.0, hue_high_deg=40.0)
    image = np.zeros((30, 30, 3), np.uint8)
    image[:, 15:] = patch(20)[0, 0]
    image[7, 7] = patch(20)[0, 0]
    image[20, 22] = 0
    mask = colour_mask(image, wanted)
    assert not mask[:, :15].any()
    assert mask[1:-1, 16:-1].all()


@pytest.mark.parametrize(
    ("bounds", "named"),
    [
        ({"hue_low_deg": -1.0, "hue_high_deg": 10.0}, "hue_low_deg"),
        ({"hue_low_deg": 0.0, "hue_high_deg": float("nan")}, "hue_high_deg"),
        ({"hue_low_deg": 0.0, "hue_high_deg": 10.0, "saturation_low": 0.6, "saturation_high": 0.5}, "saturation_high"),
        ({"hue_low_deg": 0.0, "hue_high_deg": 10.0, "value_high": 1.5}, "value_high"),
    ],
)
def test_a_bound_outside_its_scale_is_refused_by_name(bounds, named):
    with pytest.raises(ParameterError, match=named):
        ColourRange(**bounds)
