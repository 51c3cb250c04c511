"""A rope task about other ropes and fingers."""

from itertools import product

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.geometry.finger_distance import from_core
from app.core.geometry.shapes.tools import Finger
from app.core.task_name import TaskName
from app.jobs import jit_cache
from app.jobs.worker_api import nominal_model
from app.sim.model.params import index
from app.sim.rods.state import RodState
from app.tasks import load
from app.tasks.elements.curves import fill_tube

COUNT = 300
ENDS = {
    "length_m": (0.25, 0.60),
    "radius_m": (0.004, 0.010),
    "mass_kg": (0.015, 0.100),
    "finger_radius_m": (0.005, 0.012),
}
EXTREMES = [dict(zip(ENDS, values, strict=True)) for values in product(*ENDS.values())]


def named(sizes: dict[str, float], dynamics: str) -> str:
    return str(TaskName.of("rope_push", sizes, dynamics))


def pushed(task: str, stiffness_pa: float | None = None) -> tuple[RodState, RodState]:
    """Rope before and after a push through its middle, across it; of nominal stiffness, or of `stiffness_pa`."""
    data = load(task)
    x = data.particles(data.start(0), COUNT)
    middle = x.mean(0)
    nearest = x[np.linalg.norm(x - middle, axis=1).argmin(), :2]
    along = np.linalg.svd(x[:, :2] - middle[:2])[2][0]
    across = np.array([-along[1], along[0]])
    way = np.linspace(-0.05, 0.05, data.actions.substeps + 1)[:, None]
    tool = np.concatenate([nearest + way * across, np.full((len(way), 1), data.finger.push_height_m)], axis=1)
    phi = jit_cache.phi_of(nominal_model(task))
    phi[index("stiffness")] = stiffness_pa or phi[index("stiffness")]
    begin = data.initial_state(jnp.asarray(x)[None])
    carry = jit_cache.action_simulator(task, COUNT, *jit_cache.needs(task, phi))
    end = carry(jnp.asarray(phi)[None], begin, jnp.asarray(tool, jnp.float32)[None])
    assert isinstance(begin, RodState)
    assert isinstance(end, RodState)
    return begin, end


@pytest.mark.parametrize("sizes", EXTREMES, ids=lambda sizes: "-".join(f"{value:g}" for value in sizes.values()))
def test_ropes_and_fingers_of_all_sizes_are_pushed_and_keep_their_length(sizes: dict[str, float]):
    before, after = pushed(named(sizes, "rods"))
    assert 0.02 < np.linalg.norm(after.x - before.x, axis=-1).max() < 0.12
    lengths = np.linalg.norm(np.diff(after.nodes[0, :2], axis=-1), axis=0)
    assert lengths.sum() == pytest.approx(sizes["length_m"], rel=0.01)


@pytest.mark.parametrize("end", ["low", "high"])
@pytest.mark.parametrize("sizes", [EXTREMES[0], EXTREMES[6], EXTREMES[9], EXTREMES[15]])
def test_ropes_as_limp_and_as_stiff_as_their_range_allows_keep_their_length(sizes: dict[str, float], end: str):
    task = named(sizes, "rods")
    stiffness = getattr(load(task).parameters()[index("stiffness")], end)
    before, after = pushed(task, stiffness)
    assert 0.02 < np.linalg.norm(after.x - before.x, axis=-1).max() < 0.2
    lengths = np.linalg.norm(np.diff(after.nodes[0, :2], axis=-1), axis=0)
    assert lengths.sum() == pytest.approx(sizes["length_m"], rel=0.01)


@pytest.mark.parametrize("task", ["rope_push@rods", "rod_to_rope@rods", "rope_push", "rope_push(radius_m=0.012)@rods"])
def test_ranges_of_stiffness_of_two_simulators_adjoin_and_one_has_all(task: str):
    column = index("stiffness")
    usual, stiff, whole = (load(task).parameters(stiff=stiff)[column] for stiff in (False, True, None))
    assert usual.low == whole.low
    assert stiff.high == whole.high
    if usual == whole:
        assert stiff == whole
    else:
        assert usual.high < stiff.low < 1.00001 * usual.high
    for spec in (usual, stiff):
        phi = jit_cache.phi_of(nominal_model(task))
        phi[column] = spec.high
        assert jit_cache.needs(task, phi).stiff == (spec.high > usual.high)


def test_sizes_change_what_is_simulated_seen_and_shown():
    sizes = EXTREMES[0]
    task = load(named(sizes, "rods"))
    assert task.rods is not None
    assert (task.rope.length_m, task.rods.scene.length_m) == (0.25, 0.25)
    assert task.rope.radius_m == task.rods.scene.radius_m == 0.004
    assert task.scene.bodies[0].density_kg_m3 == pytest.approx(0.015 / (np.pi * 0.004**2 * 0.25))
    assert task.perception.half_width_m == pytest.approx(0.006)
    length = np.linalg.norm(np.diff(task.start(3), axis=0), axis=1).sum()
    assert length == pytest.approx(0.25)
    assert task is load(str(TaskName.parse(task.name)))


@pytest.mark.parametrize("yaw", [0.0, 0.8, np.pi / 2])
@pytest.mark.parametrize("dynamics", ["rods", "mpm"])
def test_a_flat_finger_stands_in_the_name_and_pushes_the_rope_before_all_of_its_width(dynamics: str, yaw: float):
    """A wide finger pushes alike with rods and with material points."""
    named_ = named({"finger_radius_m": 0.006, "finger_half_width_m": 0.015, "finger_yaw_rad": yaw}, dynamics)
    task = load(named_)
    assert task.finger == Finger(radius_m=0.006, push_height_m=0.006, half_width_m=0.015, yaw_rad=float(f"{yaw:.6g}"))
    line = np.stack([np.linspace(0.35, 0.75, 41), np.zeros(41), np.full(41, task.rope.radius_m)], axis=1)
    x = fill_tube(line, task.rope.radius_m, COUNT)
    begin = -task.finger.radius_m - task.rope.radius_m - abs(task.finger.half_m[1]) - 0.02
    way = np.linspace(begin, 0.03, task.actions.substeps + 1)
    tool = np.stack([np.full(len(way), 0.55), way, np.full(len(way), task.finger.push_height_m)], axis=1)
    phi = jnp.asarray(jit_cache.phi_of(nominal_model(named_)))[None]
    end = jit_cache.action_simulator(named_, COUNT)(
        phi, task.initial_state(jnp.asarray(x)[None]), jnp.asarray(tool, jnp.float32)[None]
    )
    away = np.asarray(end.x[0, :, :2]) - tool[-1, :2]
    gap = np.linalg.norm(from_core(-away, task.finger.half_m), axis=1).min()
    assert gap == pytest.approx(task.finger.radius_m, abs=0.004)
    assert away[np.abs(away[:, 0]) < 0.02, 1].max() > abs(task.finger.half_m[1]) + task.finger.radius_m
