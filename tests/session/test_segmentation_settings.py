"""The colours in use: replaced on request, refused in words, and said with what they show."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.colours import ColourRange
from app.core.dialogue.requests import ColourRequest
from app.core.dialogue.segmentation_message import Seen
from app.core.errors import DeviceError, ParameterError, PerceptionError, UsageError
from app.core.messages import fresh_id
from app.perception.mask.learned import load_segmenter
from app.perception.reconstruct import Reconstruction, diagnose_views, reconstruct
from app.recording.format.codec import decode, encode
from app.session.perception_stage import Seeing, credible, require_placed, segmentation_message
from tests.perception.onnx_model import convolution
from tests.perception.scene import ROPE_RGB, random_tube, views

HOW = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300)
REQUEST = ColourRequest(
    id=fresh_id("colours"),
    time_s=1.0,
    operator="client 3",
    hue_deg=(350.0, 30.0),
    saturation=(0.4, 1.0),
    value=(0.2, 0.9),
)


def test_other_colours_are_looked_for_from_then_on():
    seeing = Seeing(HOW)
    said = seeing.recolour(REQUEST)
    assert "client 3" in said
    assert "hue 350 to 30 degrees" in said
    assert (seeing.how.colour.hue_deg, seeing.how.colour.value) == ((350.0, 30.0), (0.2, 0.9))
    assert replace(seeing.how, colour=HOW.colour) == HOW


@pytest.mark.parametrize("wrong", [{"hue_deg": (0.0, 400.0)}, {"saturation": (0.9, 0.2)}, {"value": (0.0, np.nan)}])
def test_colours_that_are_none_are_refused_and_nothing_changes(wrong):
    seeing = Seeing(HOW)
    with pytest.raises(ParameterError, match="outside its range"):
        seeing.recolour(replace(REQUEST, **wrong))
    assert seeing.how == HOW


def test_what_was_seen_is_said_and_survives_a_recording():
    frames = views(random_tube(0))
    said = segmentation_message(frames, diagnose_views(frames, HOW), HOW, now_s=5.0)
    assert said.cause == tuple(frame.id for frame in frames)
    assert set(said.masks) == set(said.pixels) == set(said.points) == {"left", "right"}
    assert said.hue_deg == HOW.colour.hue_deg
    assert 0 < said.apart_m["left"] < 0.003
    read = decode(encode(said, Seen), Seen)
    np.testing.assert_array_equal(read.masks["left"], said.masks["left"])
    assert read.apart_m == said.apart_m


def test_colours_are_refused_where_a_trained_segmenter_finds_the_object(tmp_path):
    segmenter = load_segmenter(convolution(tmp_path / "red.onnx", ((0.0, 0.0, 0.0), (3.0, -3.0, 0.0)), (0.0, -0.6)), 1)
    seeing = Seeing(replace(HOW, segmenter=segmenter))
    with pytest.raises(UsageError, match="trained segmenter finds the object"):
        seeing.recolour(REQUEST)
    assert seeing.how.colour == HOW.colour


def test_particles_that_are_too_many_or_nowhere_are_no_object():
    found = reconstruct(views(random_tube(0)), HOW)
    assert credible(found, HOW) is found
    x, far = found.positions, np.float32(1e6)
    for wrong, why in ((x[:0], "0 particles"), (x[1:], "299"), (x + far, "nowhere"), (x * np.nan, "nowhere")):
        spoilt = replace(found, positions=wrong, predicted=np.zeros(len(wrong), bool))
        with pytest.raises(PerceptionError, match=f"{why}.*start again"):
            credible(spoilt, HOW)


def test_a_frame_of_a_camera_that_stands_nowhere_is_refused():
    frame, *_ = views(random_tube(0))
    assert require_placed(frame) is frame
    nowhere = replace(frame.camera, T_world_camera=np.full((4, 4), np.nan))
    with pytest.raises(DeviceError, match="calibrate it again"):
        require_placed(replace(frame, camera=nowhere))
