"""The simulated cell's images of bowls become the liquid that is in them, and the pieces that swim there."""

import numpy as np
import pytest

from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.shapes.fixtures import Bowl
from app.core.motion import pointing_down
from app.core.types import Points
from app.perception.body.resample import resample
from app.perception.reconstruct import _pools, reconstruct
from app.rig.simulated.cameras.simulated_cameras import SimulatedCameras
from app.rig.simulated.kinds import kind_of
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.world import Nodes, Snapshot
from app.tasks import Task, load
from app.tasks.elements.pouring import pool_points

pouring = pytest.mark.parametrize("task", [load("pour_water"), load("pour_soup")], ids=lambda task: task.name)
PARKED_POSE = pointing_down(np.array([0.30, 0.0, 0.30]))


def seen(task: Task, nodes: Nodes, tool: np.ndarray) -> Points:
    snapshot = Snapshot(time_s=0.0, nodes=nodes, tool=tool, joints=solve_joints(tool))
    frames = SimulatedCameras(task.stage, (), 0).look(snapshot, stamp_s=0.0, number=1)
    return reconstruct(frames, task.reconstruction("cpu"), tool).positions


def half_poured(task: Task, hand: np.ndarray) -> Nodes:
    """Half of the water at rest in the target bowl, the other in an upright bowl at `hand`."""
    target, volume = task.stage.fixtures[0], task.stage.body.volume_m3 / 2
    assert isinstance(target, Bowl)
    places = ((np.array(target.place_m), target.radius_m), (hand, task.stage.tool.radius_m))
    clouds = [resample(pool_points(radius, volume, 9600), 1200, seed=0) + place for place, radius in places]
    return np.concatenate(clouds).astype(np.float64)


@pouring
def test_what_is_in_the_hand_is_seen_where_it_is(task: Task) -> None:
    nodes = task.start(0)
    home = kind_of(task.stage).home(task.stage, nodes)
    found, truth = seen(task, nodes, home), task.particles(nodes, 300)
    assert chamfer_m2(found, truth) < 4e-5
    np.testing.assert_allclose(found.mean(axis=0), truth.mean(axis=0), atol=1.5e-3)
    liquid = task.scene.split(300)[0]
    if liquid < 300:
        assert chamfer_m2(found[liquid:], truth[liquid:]) < 8e-5


def test_half_of_the_water_is_seen_in_the_target_and_the_other_half_is_in_the_hand() -> None:
    task = load("pour_water")
    found = seen(task, half_poured(task, PARKED_POSE[:3]), PARKED_POSE)
    assert task.success.share(found, found) == pytest.approx(0.5, abs=0.05)
    np.testing.assert_allclose(np.median(found[found[:, 2] > 0.15], axis=0), PARKED_POSE[:3] - [0, 0, 0.04], atol=0.01)


def test_what_no_camera_sees_is_in_the_hand() -> None:
    task = load("pour_water")
    nodes = half_poured(task, PARKED_POSE[:3])
    nodes[1200:] = [0.5, 0.0, -0.5]  # Under the table.
    found = seen(task, nodes, PARKED_POSE)
    assert task.success.share(found, found) == pytest.approx(0.5, abs=0.05)
    assert np.mean(np.linalg.norm(found - PARKED_POSE[:3], axis=1) < task.stage.tool.radius_m) == pytest.approx(
        0.5, abs=0.05
    )


@pouring
def test_what_is_all_in_the_target_is_seen_there(task: Task) -> None:
    x = task.start(0)
    home = kind_of(task.stage).home(task.stage, x)
    target = task.stage.fixtures[0]
    assert isinstance(target, Bowl)
    lowest = np.array(target.place_m) - [0, 0, target.radius_m - task.stage.tool.radius_m - 0.001]
    found = seen(task, x + lowest - home[:3], PARKED_POSE)
    assert task.success.share(found, found) > 0.9


def test_drops_over_the_rim_are_no_full_bowl() -> None:
    how = load("pour_soup").perception
    (bowl,) = how.standing
    rng = np.random.default_rng(0)
    drops = rng.uniform([0.54, 0.04, 0.063], [0.56, 0.05, 0.074], (40, 3)).astype(np.float32)
    pools, rest = _pools(drops, how)
    assert not pools
    assert not len(rest)
    # A tenth of a surface that stands half way up is one: the rest is behind the bowl in the hand.
    level_m = bowl.place_m[2] - bowl.radius_m / 2
    shown = rng.uniform([0.53, -0.02, level_m - 0.001], [0.57, 0.02, level_m + 0.001], (400, 3)).astype(np.float32)
    (pool,), _ = _pools(np.concatenate([shown, drops]), how)
    assert pool.level_m == pytest.approx(level_m, abs=1e-3)
    assert pool.surface_m2 == pytest.approx(0.75 * np.pi * bowl.radius_m**2, rel=0.05)
