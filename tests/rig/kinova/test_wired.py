"""The simulated cell with its arm at the wire: what is approved moves the rope of the world, over the protocol."""

import numpy as np
import pytest
from anyio import to_thread

from app.commands._wired import wired_arm
from app.config import Site
from app.core.stage import Stage
from app.rig.simulated.arm_model import solve_joints
from app.rig.simulated.rig import simulated_rig
from tests.rig.kinova.conftest import until
from tests.rig.scene import FINGER, ROPE, approved, push, straight_rope


@pytest.mark.anyio
async def test_a_push_over_the_wire_moves_the_rope_of_the_world() -> None:
    stage = Stage(body=ROPE, tool=FINGER)
    async with (
        wired_arm() as take,
        simulated_rig(stage=stage, start=straight_rope(), site=Site(), seed=0, take=take) as rig,
    ):
        before = rig.truth().nodes
        done = await rig.arm.execute(approved(push((0.44, 0.0), (0.52, 0.0))))
        state = await rig.arm.state()
        # The world follows as fast as the machine lets it.
        await to_thread.run_sync(until, lambda: np.linalg.norm(rig.truth().tool[:3] - done.measured[-1][:3]) < 5e-3)
        after = rig.truth()
    assert done.outcome == "completed", done.reason
    middle = len(before) // 2
    assert after.nodes[middle, 0] - before[middle, 0] > 0.015
    assert np.abs(after.nodes[middle, 0] - before[middle, 0]) < 0.05
    assert state.joints == pytest.approx(solve_joints(state.tool))
