"""Ropes of our own rod: other numerics, another contact; what is hidden in them is in what discovery reads."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.discovery.dataset.study import Study
from app.policy.random_pushes import PushDesign
from app.services.study import read_study
from app.sim.rods.effect import RodSetting
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.state import RodState
from bench.hidden.draws import Chosen
from bench.hidden.made import make
from bench.hidden.outside import OUTSIDE
from bench.hidden.own_ropes import OwnRope
from bench.hidden.sizes import drawn_sizes
from tests.sim.pushed_ropes import SCENE, curve, lying

PLAN = PushDesign(episodes=2, pushes=2)
G = 9.81


def recorded(*hidden: str, size: float = 1.0, seed: int = 7) -> tuple[OwnRope, Study]:
    case = OwnRope(seed=seed, hidden=tuple(Chosen(effect=name, size=size) for name in hidden), plan=PLAN)
    return case, case.record()


@pytest.fixture(scope="module")
def control() -> tuple[OwnRope, Study]:
    return recorded()


def middles(study: Study) -> np.ndarray:
    """Middle of each cloud [m], shape (K, 3, 3): before, during, after."""
    return np.array(
        [[view.points.mean(0) for view in (push.before, push.during[0], push.after)] for push in study.pushes]
    )


def test_numerics_and_contact_are_not_the_models() -> None:
    for seed in range(5):
        case = OwnRope(seed=seed)
        assert case.subject.rods is not None
        model, world = case.subject.rods, case.rods
        assert world.scene.nodes > 1.3 * model.scene.nodes
        assert world.scene.dt_s == pytest.approx(model.scene.dt_s / 2)
        known, nominal = dict(world.contact), {**model.scene.nominal_physics(), **dict(model.contact)}
        assert {"climb", "press", "margin", "viscosity", "yield_curvature", "mass", "creep"} <= known.keys()
        assert sum(abs(known[name] / nominal[name] - 1) > 1e-3 for name in known) >= len(known) - 1


def test_the_same_seed_makes_the_same_recording_and_rods_go_on_from_where_they_were(
    control: tuple[OwnRope, Study],
) -> None:
    _, study = control
    _, again = recorded()
    np.testing.assert_array_equal(middles(study), middles(again))
    places = middles(study)
    np.testing.assert_allclose(places[0, 2], places[1, 0], atol=2e-3)  # As far as cameras see it.
    assert np.linalg.norm(places[1, 2] - places[2, 0]) > 0.01  # Another episode lays the rope anew.


def test_cameras_that_stand_elsewhere_show_everything_there_and_nothing_else_changes(
    control: tuple[OwnRope, Study],
) -> None:
    case, study = recorded("hand_eye_translation")
    values = case.world.effects[0]["parameters"]
    offset = np.array([values[f"hand_eye_{axis}"]["value"] for axis in "xyz"])
    assert np.linalg.norm(offset) == pytest.approx(0.003, rel=1e-3)
    np.testing.assert_allclose(middles(study) - middles(control[1]), np.broadcast_to(offset, (4, 3, 3)), atol=2e-5)
    for push, other in zip(study.pushes, control[1].pushes, strict=True):
        np.testing.assert_array_equal(push.command.poses, other.command.poses)
    np.testing.assert_allclose(study.tables[0].mean(0) - control[1].tables[0].mean(0), offset, atol=1e-6)


def test_a_delay_is_in_the_arms_log_and_a_film_in_the_ropes_motion(control: tuple[OwnRope, Study]) -> None:
    _, late = recorded("command_delay")
    first, usual = late.pushes[0], control[1].pushes[0]
    assert first.measured is not None
    assert usual.measured is not None
    at = usual.command.times_s[20:-20]
    np.testing.assert_allclose(first.measured.at(at + 0.1), usual.command.at(at), atol=8e-4)
    _, film = recorded("viscous_film", size=2.0)
    assert np.linalg.norm(middles(film)[:, 2] - middles(control[1])[:, 2], axis=1).max() > 1e-3


@pytest.mark.parametrize("world", ["own", "mujoco"])
def test_recordings_hold_the_study_and_no_word_of_what_is_hidden(world: str, tmp_path: Path) -> None:
    order = {
        "task": "rope_push",
        "world": world,
        "seed": 41,
        "hidden": [["table_tilt", 1.0]],
        "episodes": 1,
        "pushes": 2,
    }
    make(order, tmp_path)
    paths = sorted((tmp_path / "recordings").iterdir())
    study = read_study(paths)
    assert [len(push.during) for push in study.pushes] == [1, 1]
    assert study.task.startswith("rope_push(")
    text = b"".join(path.read_bytes() for path in paths)
    assert not [word for word in ("table_tilt", "hidden", "truth", "bench") if word.encode() in text]
    assert '"table_tilt"' in (tmp_path / "truth.json").read_text()


def test_sizes_are_the_same_without_grippers_and_a_quarter_have_one_at_any_yaw() -> None:
    drawn = [drawn_sizes(seed, flat=0.25) for seed in range(400)]
    flat = [sizes for sizes in drawn if "finger_yaw_rad" in sizes]
    assert len(flat) / len(drawn) == pytest.approx(0.25, abs=0.06)
    yaws = np.array([sizes["finger_yaw_rad"] for sizes in flat])
    assert yaws.min() < -2.5
    assert yaws.max() > 2.5
    for seed, sizes in enumerate(drawn):
        assert {name: sizes[name] for name in drawn_sizes(seed)} == drawn_sizes(seed)


def moved(name: str, phi: list[float], velocity: tuple[float, float], seconds: float) -> RodState:
    """A straight rope about (0.1, 0), thrown with this velocity on a table without friction, under a force."""
    simulate = jax.jit(make_rod_rollout(SCENE, (OUTSIDE[name],)))
    line = curve(0.0) + np.array([0.1, 0.0])
    state = lying(line)
    state = state._replace(nodes=state.nodes.at[:, 2:4].set(jnp.array(velocity)[None, :, None]))
    physics = RodPhysics.nominal(SCENE, 1)._replace(table_friction=jnp.full(1, 1e-7))
    away = jnp.tile(jnp.array([0.0, 0.0, 0.5]), (1, round(seconds / SCENE.dt_s) + 1, 1))
    return simulate(physics, state, away, jnp.array([phi], jnp.float32), RodSetting.unknown(1, SCENE.nodes))


def test_a_quadratic_drag_slows_a_rope_as_the_square_of_its_speed() -> None:
    """v = v0 / (1 + q h v0 t), where h is the share of the section that is near the table: 1 - 8 mm / 20 mm."""
    state = moved("quadratic_drag", [20.0], (0.0, 0.4), 0.2)
    np.testing.assert_allclose(state.nodes[0, 3], 0.4 / (1 + 20 * 0.6 * 0.4 * 0.2), rtol=2e-3)


def test_a_sideways_pull_turns_the_motion_and_does_no_work() -> None:
    """The heading turns at the rate a / v, with the acceleration a = f g."""
    state = moved("sideways_drift", [0.15], (0.4, 0.0), 0.1)
    vx, vy = np.asarray(state.nodes[0, 2:4], np.float64).mean(1)
    assert np.arctan2(vy, vx) == pytest.approx(0.15 * G * 0.1 / 0.4, rel=0.01)
    assert np.hypot(vx, vy) == pytest.approx(0.4, rel=2e-3)


def test_a_swirl_pulls_round_its_middle() -> None:
    """The middle of a straight rope through (0.1, 0) is pulled by s g 0.1 m along y about the origin."""
    state = moved("swirl", [0.8, 0.0, 0.0], (0.0, 0.0), 0.05)
    vx, vy = np.asarray(state.nodes[0, 2:4], np.float64).mean(1)
    assert vy == pytest.approx(0.8 * G * 0.1 * 0.05, rel=0.02)
    assert abs(vx) < 0.02 * vy
