"""Display of the cameras: their cards, the masks painted into their pictures, and the clouds over the scene."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from viser import ViserServer

from app.core.colours import colour_mask
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.server.viser_host import ViserHost
from app.ui.view import overlays, views
from app.ui.view.clouds import SURFACE, Clouds, readings
from tests.ui import synthetic
from tests.ui.test_console_state import state_after

TODAY = date(2026, 11, 23)
ROPE = synthetic.rope(0.5)
LEFT, RIGHT = (synthetic.frame(synthetic.camera(name, turn), ROPE) for name, turn in (("left", -1.0), ("right", 1.0)))
REAL = replace(synthetic.episode(), simulated=False)


@pytest.fixture
def server() -> Iterator[ViserServer]:
    viser_host = ViserHost(label="test", passphrase="x")
    yield viser_host.server
    viser_host.close()


@pytest.mark.parametrize(
    ("calibrated_at", "said", "stale"),
    [
        ("2026-11-23", "today", False),
        ("2026-11-22T10:30:00", "yesterday", False),
        ("2026-11-20", "3 days ago", False),
        ("2026-10-24", "30 days ago", False),
        ("2026-10-23", "31 days ago: stale, check it or calibrate again", True),
        ("2027-01-01", "on 2027-01-01, which is to come", True),
        ("lately", "on 'lately', which is no day", True),
        ("", "never dated", True),
    ],
)
def test_the_age_of_a_calibration_is_said_and_an_old_one_is_warned_of(calibrated_at: str, said: str, stale: bool):
    camera = replace(LEFT.camera, calibrated_at=calibrated_at)
    assert views.calibration_age(camera, origin="real", today=TODAY) == (said, stale)
    assert views.calibration_age(camera, origin="simulated", today=TODAY) == ("simulated, exact", False)
    assert views.calibration_age(camera, origin="recorded", today=TODAY) == ("as it was when this was recorded", False)


@pytest.mark.parametrize(
    ("checked_at", "doubt", "said", "stale"),
    [
        ("2026-11-20", "", "62 days ago, checked on 2026-11-20", False),
        ("2026-10-01", "", "62 days ago, checked on 2026-10-01: stale, check it or calibrate again", True),
        ("", "checked on 2026-11-20: it has moved.", "62 days ago; checked on 2026-11-20: it has moved.", True),
    ],
)
def test_a_check_that_was_stood_makes_a_calibration_fresh_and_one_that_was_not_makes_it_stale(
    checked_at: str, doubt: str, said: str, stale: bool
):
    camera = replace(LEFT.camera, calibrated_at="2026-09-22", checked_at=checked_at, doubt=doubt)
    assert views.calibration_age(camera, origin="real", today=TODAY) == (said, stale)
    assert camera.stale(TODAY) == stale


def test_a_camera_s_card_has_pixels_points_distance_and_whether_its_picture_is_live():
    seen = synthetic.seen(LEFT, RIGHT)
    state = state_after(REAL, LEFT, seen)
    html = views.camera(state, LEFT, LEFT.time_s + 0.6, today=TODAY)
    assert f"{seen.pixels['left']:,}".replace(",", "\N{NARROW NO-BREAK SPACE}") in html
    assert "1.6 mm" in html
    assert "live" in html
    assert "preview" not in html
    assert '<span class="dp-warn">never dated</span>' in html
    late = views.camera(state, LEFT, LEFT.time_s + 7.0, today=TODAY, previewed=0)
    assert '<span class="dp-warn">7.0 s old</span>' in late
    assert 'Pixels in preview</td><td><span class="dp-warn">0</span>' in late
    assert "Pixels of the object" not in views.camera(ConsoleState(), LEFT, LEFT.time_s, today=TODAY)


def test_cameras_that_disagree_are_warned_of():
    agreeing = views.summary(state_after(synthetic.particles(ROPE), synthetic.seen(LEFT, RIGHT)))
    assert "300" in agreeing
    assert "dp-warn" not in agreeing
    assert "calibrate the camera" in views.summary(state_after(synthetic.seen(LEFT, RIGHT, apart_m=0.0052)))
    assert "dp-warn" not in views.summary(ConsoleState())


def test_the_masked_pixels_are_tinted_their_outline_is_drawn_and_the_rest_stays():
    image = np.full((12, 12, 3), 100, np.uint8)
    mask = np.zeros((12, 12), bool)
    mask[3:8, 4:9] = True
    painted = overlays.tint(image, mask, (255, 0, 0))
    assert (painted[~mask] == 100).all()
    assert (painted[3, 4] == (255, 0, 0)).all()
    assert 100 < painted[5, 6, 0] < 255
    assert overlays.outline(mask).sum() == 16
    assert not overlays.outline(np.ones((5, 5), bool)).any()
    assert (image == 100).all()


@pytest.mark.parametrize("shape", [(480, 640, 3), (240, 320, 3), (481, 641, 3)])
def test_a_thinned_mask_is_spread_over_its_image(shape: tuple[int, int, int]):
    step = overlays.stride(shape[1])
    mask = np.zeros(shape[:2], bool)
    mask[100:140, 60:90] = True
    spread = overlays.enlarge_mask(mask[::step, ::step], shape)
    assert spread.shape == shape[:2]
    assert (spread == mask).mean() > 0.999
    assert not overlays.enlarge_mask(np.ones((2, 4), bool), (480, 640, 3)).any()


def test_a_camera_s_readings_lie_where_they_are_seen():
    cloud = readings(LEFT)
    assert 0 < len(cloud.points) <= 6000
    assert cloud.points.shape == cloud.colours.shape
    pose, K = LEFT.camera.T_world_camera, LEFT.camera.K
    pixels = (cloud.points - pose[:3, 3]) @ pose[:3, :3] @ K.T
    np.testing.assert_allclose(pixels[:, 2], 0.7, atol=1e-5)
    column, row = np.rint(pixels[:, :2] / pixels[:, 2:]).astype(int).T
    np.testing.assert_array_equal(LEFT.color[row, column], cloud.colours)


@pytest.mark.serial
def test_clouds_are_drawn_where_they_are_wanted_follow_the_frames_and_go(server: ViserServer):
    clouds, state = Clouds(server), state_after(LEFT, RIGHT, synthetic.particles(ROPE))
    clouds.paint(state)
    assert clouds.counts == {}
    clouds.cameras = "by camera"
    clouds.paint(state)
    assert set(clouds.counts) == {"left", "right"}
    first, second = (clouds.handles[name] for name in ("left", "right"))
    assert (first.colors == palette.camera(0)).all()
    assert (second.colors == palette.camera(1)).all()

    clouds.cameras, clouds.surface = "as seen", True
    blind = replace(LEFT, depth=np.zeros_like(LEFT.depth))
    clouds.paint(state.after(blind))
    assert clouds.counts == {"left": 0, "right": len(readings(RIGHT).points), SURFACE: 300}
    np.testing.assert_array_equal(second.colors, readings(RIGHT).colours)

    clouds.cameras, clouds.surface = "off", False
    clouds.paint(state)
    assert clouds.counts == {}


def test_how_many_points_are_drawn_is_said():
    assert "left: 4\N{NARROW NO-BREAK SPACE}800 points" in views.clouds({"left": 4800})
    assert "No clouds" in views.clouds({})


def test_the_mask_of_the_console_is_that_of_perception():
    seen = synthetic.seen(LEFT)
    whole = colour_mask(LEFT.color, synthetic.COLOUR)
    assert seen.pixels["left"] == whole.sum() > 100
