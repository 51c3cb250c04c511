"""Laws of a grasp on a cloth, and of racks that lie along either axis."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.sim.materials.cloth import ClothMaterial
from app.sim.materials.threads import cloth_at_rest
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import State
from app.sim.tools.grasp import Grasp
from app.sim.tools.rod import RackCollider

ROWS, SPACING_M, STEPS = 9, 0.015, 120
PHI = jnp.array([[8.0e4, 0.5]], jnp.float32)
MIDDLE = 4 * ROWS + 4
GRASP = Grasp(reach_m=(0.02, 0.02, 0.02), closed_m=0.012)


def scene(tool: Grasp | RackCollider) -> Scene:
    side = ROWS * SPACING_M
    return Scene(
        low=(-0.15, -0.15, -0.03),
        high=(0.15, 0.15, 0.27),
        cell_m=0.03,
        dt_s=2e-3,
        damping_1_s=6.0,
        bodies=(Body(volume_m3=side**2 * 1e-3, density_kg_m3=200.0, material=ClothMaterial(), stiffness=0.2),),
        tools=(tool,),
        contact_margin_m=0.003,
        contact_width_m=0.001,
    )


def flat(z_m: float, *, aside_m: float = 0.0) -> jnp.ndarray:
    axis = (np.arange(ROWS) - ROWS // 2) * SPACING_M
    x, y = np.meshgrid(axis + aside_m, axis, indexing="ij")
    return jnp.asarray(np.stack([x, y, np.full_like(x, z_m)], axis=-1).reshape(1, -1, 3), jnp.float32)


@pytest.fixture(scope="module")
def simulate() -> Simulate:
    return make_rollout(scene(GRASP), particle_count=ROWS**2, effects=())


def path(*marks: tuple[float, float]) -> jnp.ndarray:
    """Path of a gripper upright over the middle, through these heights and openings [m], evenly in time."""
    z, opening = np.array(marks).T
    at = np.linspace(0, len(marks) - 1, STEPS + 1)
    told = np.zeros((1, STEPS + 1, 8), np.float32)
    told[..., 2], told[..., 3] = np.interp(at, np.arange(len(marks)), z), 1.0
    told[..., 7] = np.interp(at, np.arange(len(marks)), opening)
    return jnp.asarray(told)


LIFT, LET_GO = path((0.002, 0.004), (0.08, 0.004)), path((0.08, 0.004), (0.08, 0.04), (0.2, 0.04), (0.2, 0.04))


def test_what_is_within_reach_of_closed_fingers_goes_with_them_and_the_rest_follows(simulate: Simulate):
    before = cloth_at_rest(flat(0.002))
    end = simulate(PHI, before, LIFT)
    moved = np.asarray(end.x - before.x)[0]
    assert moved[MIDDLE] == pytest.approx([0.0, 0.0, 0.078], abs=0.003)
    assert 0.0 < moved[4 * ROWS, 2] < 0.06
    # It hangs in a cone about the grasp, the same on all sides.
    corners = np.asarray(end.x)[0].reshape(ROWS, ROWS, 3)[[0, 0, -1, -1], [0, -1, 0, -1], 2]
    assert np.ptp(corners) < 0.003


def test_fingers_that_are_open_or_out_of_reach_hold_nothing(simulate: Simulate):
    before = cloth_at_rest(flat(0.002))
    for told in (path((0.002, 0.04), (0.08, 0.04)), path((0.04, 0.004), (0.12, 0.004))):
        assert np.asarray(simulate(PHI, before, told).x)[0, :, 2].max() < 0.01


def test_fingers_that_open_let_go(simulate: Simulate):
    held = simulate(PHI, cloth_at_rest(flat(0.002)), LIFT)
    dropped = simulate(PHI, held, LET_GO)
    assert np.asarray(dropped.x)[0, MIDDLE, 2] < np.asarray(held.x)[0, MIDDLE, 2] - 0.02


def test_the_gradient_of_what_is_held_with_respect_to_the_fingers_equals_central_differences(simulate: Simulate):
    before = cloth_at_rest(flat(0.002))
    weights = jnp.asarray(np.random.default_rng(0).normal(size=before.x.shape), jnp.float32)
    ramp = jnp.linspace(0.0, 1.0, STEPS + 1)

    def cost(shift: jnp.ndarray) -> jnp.ndarray:
        """Cost if the fingers end elsewhere by `shift` (x, y, z)."""
        told = LIFT.at[0, :, :3].add(ramp[:, None] * shift)
        return (weights * simulate(PHI, before, told).x).sum()

    slope, step = np.asarray(jax.grad(cost)(jnp.zeros(3))), 2e-3
    for axis in range(3):
        aside = step * jnp.eye(3)[axis]
        expected = float(cost(aside) - cost(-aside)) / (2 * step)
        assert slope[axis] == pytest.approx(expected, abs=0.05 * float(np.abs(slope).max()))


def test_a_rack_along_x_does_what_one_along_y_does_seen_from_its_side():
    ends = list[np.ndarray]()
    for along in ("y", "x"):
        rack = RackCollider(
            count=2, spacing_m=0.05, half_length_m=0.1, radius_m=0.01, place_m=(0, 0, 0.15), friction=0.5, along=along
        )
        run = make_rollout(scene(rack), particle_count=ROWS**2, effects=())
        start: State = cloth_at_rest(flat(0.165, aside_m=0.01))
        if along == "x":
            start = cloth_at_rest(flat(0.165, aside_m=0.01)[..., jnp.array([1, 0, 2])])
        end = np.asarray(run(PHI, start, jnp.zeros((1, 3 * STEPS + 1, 0))).x)[0]
        ends.append(end if along == "y" else end[:, [1, 0, 2]])
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)
    assert ends[0][:, 2].min() < 0.14
    assert ends[0][:, 2].max() > 0.155
