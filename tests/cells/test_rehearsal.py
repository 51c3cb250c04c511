"""The rehearsal: images pass the cameras' SDK, and what is approved moves the rope over the arm's protocol."""

from dataclasses import replace

import numpy as np
import pytest
from anyio import to_thread

from app import cells
from app.cells.base import Wanted
from app.config import Limits, Site, Workspace
from app.core.colours import ColourRange
from app.core.geometry.scene_description import Stage
from app.core.geometry.table_place import TablePlace
from app.perception.reconstruct import Reconstruction, reconstruct
from app.rig.simulated.worlds.arm_model import solve_joints
from bench.tube import Tube
from tests.rig.kinova.conftest import until
from tests.rig.scene import FINGER, ROPE, approved, push, straight_rope

REHEARSAL = cells.load("rehearsal")
WANTED = Wanted(stage=Stage(body=ROPE, tool=FINGER), start=straight_rope(), site=Site(), seed=0)


@pytest.mark.anyio
@pytest.mark.parametrize(
    "table",
    [
        TablePlace(place_m=(0.05, -0.2, -0.15), turn_deg=30.0),
        pytest.param(TablePlace(place_m=(0.05, 0.2, 0.15), turn_deg=-30.0), marks=pytest.mark.slow),
    ],
)
async def test_a_push_on_a_table_somewhere_else_is_told_where_that_is(table: TablePlace) -> None:
    limits = replace(Limits(), workspace=Workspace(low=(0.25, -0.35, 0.005), high=(0.85, 0.35, 0.65)))
    async with REHEARSAL.open(replace(WANTED, site=Site(limits=limits, table=table))) as rig:
        laid = rig.truth().nodes
        done = await rig.arm.execute(approved(push((0.44, 0.0), (0.52, 0.0))))
        await to_thread.run_sync(until, lambda: np.linalg.norm(rig.truth().tool[:3] - done.measured[-1][:3]) < 5e-3)
        pushed = rig.truth().nodes
        told = await to_thread.run_sync(rig.fake.commands)
    assert done.outcome == "completed", done.reason
    middle = len(laid) // 2
    assert 0.015 < pushed[middle, 0] - laid[middle, 0] < 0.05
    there = np.concatenate([np.reshape(each["positions"], (-1, 3)) for each in told])
    lowest = there[there[:, 2] < there[:, 2].min() + 1e-3]
    for here in ((0.44, 0.0, 0.006), (0.52, 0.0, 0.006)):
        base = table.base_from_table[:3, :3] @ here + table.place_m
        assert np.linalg.norm(lowest - base, axis=1).min() < 1e-4


@pytest.mark.anyio
async def test_the_rope_is_seen_through_the_sdk_and_pushed_over_the_wire() -> None:
    async with REHEARSAL.open(WANTED) as rig:
        assert rig.simulated
        frames = [await camera.read() for camera in rig.cameras]
        again = await rig.cameras[0].read()
        laid = rig.truth().nodes
        done = await rig.arm.execute(approved(push((0.44, 0.0), (0.52, 0.0))))
        state = await rig.arm.state()
        # The world follows as fast as the machine lets it.
        await to_thread.run_sync(until, lambda: np.linalg.norm(rig.truth().tool[:3] - done.measured[-1][:3]) < 5e-3)
        pushed = rig.truth().nodes
        told = await to_thread.run_sync(rig.fake.commands)
    assert again.time_s > frames[0].time_s
    rope = Tube(curve=laid, radius_m=ROPE.radius_m)
    how = Reconstruction(colour=ColourRange.around(ROPE.colour), particle_count=300)
    positions = (await to_thread.run_sync(reconstruct, frames, how)).positions
    assert rope.outside(positions).mean() < 0.01
    assert rope.uncovered(rope.samples(3000, np.random.default_rng(0)), positions).mean() < 0.01
    assert done.outcome == "completed", done.reason
    middle = len(laid) // 2
    assert 0.015 < pushed[middle, 0] - laid[middle, 0] < 0.05
    assert state.joints == pytest.approx(solve_joints(state.tool))
    # The wire has single precision.
    assert 0.0 < max(each["linear_m_s"] for each in told) <= Site().limits.speed_m_s * (1 + 1e-6)
