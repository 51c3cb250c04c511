"""The simulated world, seen through the SDK: what its alignment makes of two views is what one camera sees."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.geometry.scene_description import Stage
from app.core.motion import pointing_down
from app.rig.realsense.sdk.sdk import Sdk
from app.rig.realsense.sdk.software import CameraDescription
from app.rig.realsense.sdk.sources import RecordedSource
from app.rig.realsense.sdk.synthetic import ImagerPair, record
from app.rig.realsense.settings import StreamSettings
from app.rig.realsense.stream import AlignedImages, StreamEnded, streaming
from app.rig.simulated.cameras.cameras import CameraNoise, table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Snapshot
from tests.rig.scene import FINGER, ROPE, straight_rope

STAGE = Stage(body=ROPE, tool=FINGER)
NOISELESS = CameraNoise(depth_per_m=0.0, edge_dropout=0.0, grazing_dropout=0.0, colour_levels=0.0)
UNIT_M = 0.00025


def played(file: Path, settings: StreamSettings) -> AlignedImages:
    with streaming(Sdk.load(), RecordedSource(file=file), settings) as stream:
        shots = list[AlignedImages]()
        while True:
            try:
                shot = stream.next()
            except StreamEnded:
                return shots[-1]
            if shot is not None:
                shots.append(shot)


@pytest.mark.serial
def test_a_rope_on_the_table_has_the_depth_and_colour_that_a_camera_at_the_colour_imager_sees(tmp_path: Path) -> None:
    model = replace(table_cameras()[0], depth_unit_m=UNIT_M)
    body = CameraDescription.like_d435(model, "0123")
    home = pointing_down(np.array([0.40, 0.25, 0.30]))
    world = Snapshot(time_s=0.0, nodes=straight_rope(), tool=home, joints=solve_joints(home))
    rng = np.random.default_rng(0)
    color, expected = render(world, model, rng, stage=STAGE, noise=NOISELESS)
    _, depth = render(world, body.depth_view(model), rng, stage=STAGE, noise=NOISELESS)
    start_s = time.time()
    record(
        tmp_path / "rope.db3",
        body,
        (ImagerPair(color=color, depth=depth, stamp_s=start_s + number / body.rate_hz) for number in range(4)),
    )
    shot = played(tmp_path / "rope.db3", StreamSettings(warm_up=0))
    assert np.array_equal(shot.color, color)
    seen = (shot.depth > 0) & (expected > 0)
    error_m = np.abs(shot.depth[seen].astype(float) - expected[seen]) * UNIT_M
    assert seen.mean() > 0.95
    assert np.median(error_m) < 1e-3
    assert np.mean(error_m < 3e-3) > 0.97, "all but edges, where a pixel aside is another surface"
    rope = (color[..., 0] > 1.5 * color[..., 1]) & seen
    assert rope.sum() > 500
    assert np.median(np.abs(shot.depth[rope].astype(float) - expected[rope])) * UNIT_M < 1e-3
