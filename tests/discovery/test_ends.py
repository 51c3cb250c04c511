"""Ropes that were laid the other way round in some episodes: what acts along them is found all the same."""

from dataclasses import replace

import numpy as np
import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.inference.ends import find_ends, turn_rows
from app.discovery.inference.screen import steps_of
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import residuals
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from bench.hidden.ropes import RopeCase
from tests.discovery.test_inference import PRIOR, K, P, made, weighed

ODD = 5
"""The column of the parameter that changes its sign with the direction."""


def laid(seed: int, size: float) -> tuple[Residuals, np.ndarray]:
    """A world in which it has this size, and the way round of each episode, which the slopes do not know."""
    theta = np.zeros(P)
    theta[0], theta[ODD] = 0.8, size
    straight = made(seed, theta)
    signs = np.random.default_rng(seed + 100).choice([-1.0, 1.0], K // 6)
    J = straight.J.copy()
    J[:, :, ODD] *= signs[straight.episode][:, None]
    return replace(straight, J=J), signs


@pytest.mark.parametrize("seed", range(3))
def test_the_way_round_of_every_episode_is_found_but_for_which_of_both_is_which(seed: int) -> None:
    data, signs = laid(seed, 0.9)
    found = np.array(list(find_ends(data, PRIOR, [ODD]).values()))
    assert abs(found @ signs) == len(signs)


def test_what_cancels_over_episodes_is_evident_once_they_are_turned() -> None:
    data, _ = laid(0, 0.9)
    straight = turn_rows(data, find_ends(data, PRIOR, [ODD]), [ODD])
    before, after = (weighed(each).findings[ODD - 2] for each in (data, straight))
    assert after.log_bayes > before.log_bayes + 10
    assert abs(after.mean[0]) == pytest.approx(0.9, abs=0.2)


def test_where_nothing_acts_along_ropes_the_choice_gains_no_more_than_it_costs() -> None:
    gains = list[float]()
    for seed in range(10):
        data, signs = laid(seed, 0.0)
        straight = turn_rows(data, find_ends(data, PRIOR, [ODD]), [ODD])
        cost = (len(signs) - 1) * np.log(2)
        gains.append(weighed(straight).findings[ODD - 2].log_bayes - cost)
    assert max(gains) < 0


def test_without_such_parameters_nothing_is_turned() -> None:
    data, _ = laid(0, 0.9)
    assert set(find_ends(data, PRIOR, []).values()) == {1.0}


def test_pushes_of_a_rope_that_is_called_the_other_way_round_are_the_same_pushes() -> None:
    """A refit sees ropes whose ends are found; the screening, whose noise and slopes it takes over, had seen others."""
    case = RopeCase(seed=11, plan=PushDesign(episodes=2, pushes=1))
    study, subject = case.record(), subject_of(case.task)
    predictor = Predictor(subject, catalogue(subject.rods))
    trials, about = prepare(study, subject), predictor.catalogue.nominal(subject)
    steps = [
        step for step in steps_of(predictor.catalogue, (), {}) if step.cause in ("mass_heterogeneity", "table_tilt")
    ]
    odd_columns = {column for cause in predictor.catalogue.causes for column in cause.odd}
    odd, ends = [n for n, step in enumerate(steps) if step.column in odd_columns], {0: -1.0, 1: 1.0}
    first, again = (residuals(predictor, each, about, steps, starts=2) for each in (trials, trials.with_ends(ends)))
    expected = turn_rows(first, ends, odd)
    assert 0 < len(odd) < len(steps)
    assert np.abs(first.r - again.r).max() > 1e-3  # It asks something.
    for name in ("r", "J"):
        np.testing.assert_allclose(getattr(again, name), getattr(expected, name), atol=2e-5)
    actual, wanted = (each.spread @ np.swapaxes(each.spread, 1, 2) for each in (again, expected))
    np.testing.assert_allclose(actual, wanted, atol=1e-9)
