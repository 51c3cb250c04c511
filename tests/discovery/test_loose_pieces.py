"""Loose pieces: what is compared of them, the causes they are asked about, and the paddle as the simulator takes it."""

import numpy as np
import pytest

from app.config import Site
from app.core.geometry.track import Track, upright
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.displacement_field import PIECE_MODES, Basis, register
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import subject_of
from app.tasks import load

TASK = load("bean_sweep")
SUBJECT = subject_of(TASK)
ALONG_X = np.array([0.55, 0.0, 1.0, 0.0])
PERIOD_S, SLOT_S = 0.02, 10.0


def beans(seed: int = 1) -> np.ndarray:
    return TASK.problems.particles(TASK.problems.start(seed), SUBJECT.particle_count)


def sweep(x: np.ndarray, seed: int, start_s: float) -> Track:
    """A sweep of the arm at even times."""
    action = TASK.actions.sample(np.random.default_rng(seed), x, np.zeros(8), 1)[0]
    motion = TASK.actions.motion(action, np.zeros(8), Site())
    assert motion.turns is not None
    legs = zip(motion.positions[:-1], motion.positions[1:], motion.speeds[1:], strict=True)
    way = [
        np.linspace(start, end, max(2, round(float(np.linalg.norm(end - start)) / speed / PERIOD_S)), endpoint=False)
        for start, end, speed in legs
    ]
    places = np.concatenate([*way, motion.positions[-1:]])
    poses = np.concatenate([places, np.repeat(motion.turns[:1], len(places), axis=0)], axis=1)
    return Track(times_s=start_s + PERIOD_S * np.arange(len(poses)), poses=poses)


def study_of(x: np.ndarray, count: int) -> Study:
    def push(k: int) -> Push:
        track = sweep(x, k, SLOT_S * k)
        before, after = (ProjectionView(time_s=at, points=x) for at in (track.times_s[0] - 0.1, track.end_s + 1.0))
        return Push(episode=k, before=before, during=(), after=after, command=track, measured=track)

    return Study(task=TASK.name, pushes=tuple(push(k) for k in range(count)))


def test_causes_along_an_object_are_not_asked_about_and_those_of_grains_are():
    causes = {cause.name for cause in SUBJECT.catalogue().causes}
    assert {"cohesion", "table_tilt", "friction_map", "command_delay", "tcp_offset"} <= causes
    assert not causes & {"mass_heterogeneity", "rest_curvature", "mask_erosion", "shear_thinning"}


@pytest.mark.parametrize("shift", [(0.006, -0.004), (-0.003, 0.008)])
def test_a_shift_of_all_pieces_is_measured_as_one(shift: tuple[float, float]):
    predicted = beans()
    observed = predicted + np.array([*shift, 0.0], np.float32)
    basis = Basis.around(predicted, ALONG_X)
    found = basis.field(register(predicted, observed[np.random.default_rng(0).permutation(len(observed))], basis))
    assert found.mean(0) == pytest.approx(shift, abs=4e-4)
    assert np.abs(found - shift).max() < 2e-3


def test_pieces_that_lie_elsewhere_about_the_tool_are_no_shift_of_the_others():
    predicted = beans()
    tool = np.concatenate([predicted[0, :2], [1.0, 0.0]])
    near = np.exp(-((predicted[:, :2] - tool[:2]) ** 2).sum(1) / (2 * 0.06**2))
    observed = predicted.copy()
    observed[:, 0] += (0.01 * near).astype(np.float32)
    basis = Basis.around(predicted, tool)
    found = basis.field(register(predicted, observed, basis))
    assert found[near > 0.8, 0].mean() == pytest.approx(0.009, abs=2e-3)
    assert np.abs(found[near < 0.05]).max() < 1.5e-3


def test_modes_turn_with_the_tool():
    predicted = beans()
    ahead, across = Basis.around(predicted, ALONG_X), Basis.around(predicted, np.array([0.55, 0.0, 0.0, 1.0]))
    assert ahead.vectors.shape == (len(predicted), PIECE_MODES, 2)
    assert np.allclose(ahead.vectors[:, :6], across.vectors[:, :6])
    assert np.allclose(ahead.vectors[:, 6, ::-1], across.vectors[:, 6])


def test_a_tool_is_upright_where_the_flange_points_down():
    yaw = 0.7
    turned = np.array([[0.0, np.cos(yaw / 2), np.sin(yaw / 2), 0.0]])
    assert upright(turned)[0] == pytest.approx([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])


def test_a_sweep_is_simulated_with_the_paddle_turned_across_it():
    x = beans()
    study = study_of(x, 4)
    predictor = Predictor(SUBJECT, SUBJECT.catalogue())
    ends = predictor(prepare(study, SUBJECT), [predictor.catalogue.nominal(SUBJECT)]).after[0]
    for push, end in zip(study.pushes, ends, strict=True):
        low = push.command.positions[push.command.poses[:, 2] < SUBJECT.low_m]
        way = low[-1, :2] - low[0, :2]
        ahead = way / np.linalg.norm(way)
        offset = end[:, :2] - low[-1, :2]
        along, beside = offset @ ahead, offset @ np.array([-ahead[1], ahead[0]])
        swept = (np.abs(beside) < 0.045) & (along < -0.006) & (along > -float(np.linalg.norm(way)))
        assert swept.mean() < 0.02  # Nothing is left where the paddle's whole width went.
