"""Recordings of beans without images, each with its effects, its tuning and its noise of one seed."""

import numpy as np
import pytest

from app.core.geometry.scene_description import Beans
from app.discovery.dataset.study import ProjectionView, Study
from app.policy.random_sweeps import sweep_design
from app.rig.simulated.worlds.physics import BEAN_WORLD
from app.tasks import load
from bench.hidden.beans import BeanCase, seen_beans
from bench.hidden.draws import Chosen

PLAN = sweep_design(2, 2)


def case(*effects: str, seed: int = 7) -> BeanCase:
    return BeanCase(seed=seed, hidden=tuple(Chosen(effect=name, size=1.0) for name in effects), plan=PLAN)


@pytest.fixture(scope="module")
def control() -> Study:
    return case().record()


def views(study: Study) -> list[ProjectionView]:
    return [view for push in study.pushes for view in (push.before, *push.during, push.after)]


def test_a_study_has_a_view_before_during_and_after_each_sweep_as_many_points_as_the_preset(control: Study) -> None:
    assert control.task == "bean_sweep"
    assert [push.episode for push in control.pushes] == [0, 0, 1, 1]
    assert sorted(control.tables) == [0, 1]
    assert {view.points.shape for view in views(control)} == {(300, 3)}
    for push in control.pushes:
        (during,) = push.during
        times = (push.before.time_s, push.command.times_s[0], during.time_s, push.command.end_s, push.after.time_s)
        assert np.all(np.diff(times) > 0)
        low = push.command.times_s[push.command.positions[:, 2] < push.command.positions[:, 2].min() + 1e-6]
        assert 0.5 < (during.time_s - low[0]) / (low[-1] - low[0]) < 0.7
        assert during.finger is not None
        at = push.command.at(np.array([during.time_s]))[0]
        assert during.finger.mean(0) == pytest.approx(at, abs=2e-3)


def test_the_paddle_points_down_as_the_arm_does_across_its_way(control: Study) -> None:
    for push in control.pushes:
        way = push.command.positions[-1, :2] - push.command.positions[0, :2]
        w, x, y, z = push.command.poses[0, 3:]
        assert (w, z) == (0.0, 0.0)
        wide = np.array([x**2 - y**2, 2 * x * y])
        assert abs(wide @ way) < 1e-9 * np.linalg.norm(way)
        assert push.measured is not None
        assert np.array_equal(push.measured.poses[:, 3:], push.command.poses[:, 3:])


def test_the_same_seed_gives_the_same_bytes_and_another_another_world(control: Study) -> None:
    again, other = case().record(), case(seed=8)
    for one, two in zip(views(control), views(again), strict=True):
        assert one.points.tobytes() == two.points.tobytes()
    assert other.physics.table_friction != case().physics.table_friction
    off = other.physics.rolling.rolling_m / BEAN_WORLD.rolling.rolling_m
    assert 0.7 <= off <= 1.3


def test_what_is_hidden_changes_what_is_seen_after_the_first_sweep_and_nothing_before(control: Study) -> None:
    hidden = case("finger_friction").record()
    assert np.array_equal(hidden.pushes[0].before.points, control.pushes[0].before.points)
    assert np.array_equal(hidden.pushes[0].command.poses, control.pushes[0].command.poses)
    assert not np.array_equal(hidden.pushes[0].after.points, control.pushes[0].after.points)


def test_the_cloud_is_where_the_beans_are_and_noisier_cameras_err_more() -> None:
    task, rng = case().task, np.random.default_rng(0)
    nodes = task.start(3)
    middles = nodes.reshape(-1, 2, 3).mean(1)

    def error_m(scale: float) -> float:
        cloud = seen_beans(task, nodes, rng, scale)
        return float(np.linalg.norm(cloud[:, None, :2] - middles[:, :2], axis=2).min(1).mean())

    assert error_m(0.0) < error_m(6.0) < 0.01
    cloud = seen_beans(task, nodes, rng, 1.0)
    assert cloud[:, 2].mean() == pytest.approx(0.005, abs=5e-4)
    assert np.linalg.norm(cloud.mean(0) - middles.mean(0)) < 0.01


def test_beans_that_roll_off_the_table_are_not_seen_and_take_no_memory() -> None:
    task = load("bean_sweep")
    nodes = task.start(3)
    beyond = nodes.reshape(-1, 2, 3).copy()
    beyond[: len(beyond) // 2, :, 1] += 57.0
    cloud = seen_beans(task, beyond.reshape(-1, 3), np.random.default_rng(0), 1.0)
    assert len(cloud) == task.preset("cpu").particle_count
    assert task.perception.box.holds(cloud).all()
    with pytest.raises(ValueError, match="All beans have left"):
        seen_beans(task, nodes + np.array([0.0, 57.0, 0.0]), np.random.default_rng(0), 1.0)


def test_the_beans_number_and_mass_are_drawn_and_the_study_says_them() -> None:
    counts, masses = set[int](), list[float]()
    for seed in range(12):
        task = BeanCase(seed=seed, other_beans=True).task
        assert isinstance(task.stage.body, Beans)
        counts.add(task.stage.body.count)
        masses.append(task.stage.body.mass_kg / task.stage.body.count)
        assert len(task.start(seed)) == 2 * task.stage.body.count
        assert load(task.recorded_name) is task
    assert 30 <= min(counts) < max(counts) <= 70
    assert 0.5e-3 <= min(masses) < max(masses) <= 2e-3
    few = BeanCase(seed=3, other_beans=True, plan=sweep_design(1, 1)).record()
    assert few.task == BeanCase(seed=3, other_beans=True).task.name
    assert few.pushes[0].after.points.shape == (300, 3)
