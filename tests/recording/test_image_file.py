"""Images of every depth become the same bytes."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from app.recording.exchange.image_file import colours_in

RAMP = np.tile(np.linspace(0, 1, 64), (48, 1))
MOST = {"8": 255, "12 in 16": 4095, "16": 65535}


def png(array: np.ndarray) -> bytes:
    done, data = cv2.imencode(".png", array)
    assert done
    return data.tobytes()


@pytest.mark.parametrize("most", MOST.values(), ids=MOST)
def test_grey_of_every_depth_is_scaled_to_its_lightest(most: int) -> None:
    grey = np.round(RAMP * most).astype(np.uint8 if most == 255 else np.uint16)
    found = colours_in(png(grey))
    assert found.shape == (48, 64, 3)
    np.testing.assert_allclose(found, np.round(RAMP * 255)[..., None].repeat(3, axis=2), atol=1)


@pytest.mark.parametrize("most", MOST.values(), ids=MOST)
def test_colours_of_every_depth_are_too_and_stay_in_their_order(most: int) -> None:
    rgb = np.stack([RAMP, RAMP / 2, 0 * RAMP], axis=2)
    bgr = np.round(rgb[..., ::-1] * most).astype(np.uint8 if most == 255 else np.uint16)
    np.testing.assert_allclose(colours_in(png(bgr)), np.round(rgb * 255), atol=1)


@pytest.mark.parametrize("mode", ["L", "P", "RGBA", "1", "I", "F"])
def test_every_mode_is_read(mode: str) -> None:
    grey = Image.fromarray(np.round(RAMP * 255).astype(np.uint8))
    stream = io.BytesIO()
    grey.convert(mode).save(stream, "TIFF")
    found = colours_in(stream.getvalue())
    assert found.shape == (48, 64, 3)
    assert found.dtype == np.uint8
    assert found.max() == 255


@pytest.mark.parametrize("data", [b"", b"nonsense", b"\x89PNG\r\n\x1a\n"])
def test_nonsense_is_an_error(data: bytes) -> None:
    with pytest.raises(OSError, match="cannot identify"):
        colours_in(data)


def test_a_cut_image_is_an_error() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8)
    with pytest.raises(OSError, match="truncated"):
        colours_in(png(noise)[:1500])
