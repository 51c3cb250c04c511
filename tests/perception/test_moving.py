"""Objects that hang or flow are seen as if there were no frames before."""

from dataclasses import replace

import numpy as np

from app.core.colours import ColourRange
from app.perception.reconstruct import PriorKnowledge, Reconstruction, reconstruct
from bench.tube import Tube
from tests.perception.scene import ROPE_RGB, views


def test_an_object_that_moves_by_itself_is_seen_as_without_the_frames_before(tube):
    how = Reconstruction(colour=ColourRange.around(ROPE_RGB), particle_count=300, hidden_s=0.0)
    moved = Tube(curve=tube.curve + np.array([0.004, 0.0, 0.02]), radius_m=tube.radius_m)
    before, now = views(tube, 0), [replace(frame, time_s=0.5) for frame in views(moved, 1)]
    known = PriorKnowledge(before=tuple(before), memory=reconstruct(before, replace(how, hidden_s=60.0)).memory)
    np.testing.assert_array_equal(
        reconstruct(now, how, known=replace(known, memory=reconstruct(before, how).memory)).positions,
        reconstruct(now, how).positions,
    )
    assert not np.array_equal(
        reconstruct(now, replace(how, hidden_s=60.0), known=known).positions, reconstruct(now, how).positions
    )
