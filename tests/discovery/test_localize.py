"""Causes that act at a place: the lattice on which they are sought, its score test, and an obstacle that is found."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.inference.localize import KEPT, lattice, log_bayes_of_each
from app.discovery.inference.screen import refit, screen
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from bench.hidden.draws import Chosen
from bench.hidden.own_ropes import OwnRope
from tests.discovery.test_inference import PRIOR, P, made

SPACING_M = 0.02
NUISANCES = 2


def scored(theta: np.ndarray, *, one_sided: bool = False) -> np.ndarray:
    """Evidence of all columns of a linear world but its two nuisances."""
    known = type(PRIOR)(mean=PRIOR.mean[:NUISANCES], variance=PRIOR.variance[:NUISANCES], nuisance=(0, 1))
    return log_bayes_of_each(made(3, theta), known, [one_sided] * (P - NUISANCES))


def test_the_column_that_acts_has_the_most_evidence_whatever_the_nuisances_are() -> None:
    theta = np.zeros(P)
    theta[7] = 0.5
    alone = scored(theta)
    theta[:NUISANCES] = 1.0, -1.5
    beside = scored(theta)
    assert np.argmax(alone) == np.argmax(beside) == 7 - NUISANCES
    assert beside[7 - NUISANCES] > 10
    assert np.delete(beside, 7 - NUISANCES).max() < 0.5 * beside[7 - NUISANCES]


def test_where_nothing_acts_evidence_is_against_most_columns() -> None:
    assert np.median(scored(np.zeros(P))) < 0


def test_what_would_have_to_be_negative_and_cannot_be_has_no_evidence() -> None:
    theta = np.zeros(P)
    theta[7] = -0.5
    assert scored(theta)[7 - NUISANCES] > 10
    assert scored(theta, one_sided=True)[7 - NUISANCES] < 0


@given(st.integers(0, 2**31), st.integers(2, 6))
def test_nodes_are_where_something_moved_in_two_pushes(seed: int, pushes: int) -> None:
    rng = np.random.default_rng(seed)
    swept = [rng.uniform(-0.1, 0.1, (rng.integers(0, 40), 2)) for _ in range(pushes)]
    nodes = lattice(swept, SPACING_M)
    for node in nodes:
        near = [bool(len(places)) and (np.abs(places - node).max(1) <= SPACING_M / 2 + 1e-9).any() for places in swept]
        assert sum(near) >= 2
    assert len(np.unique(np.rint(nodes / SPACING_M), axis=0)) == len(nodes)


def test_where_nothing_moved_there_is_no_node() -> None:
    assert lattice([np.zeros((0, 2)), np.zeros((0, 2))], SPACING_M).shape == (0, 2)
    assert lattice([np.zeros((5, 2))], SPACING_M).shape == (0, 2)


@pytest.mark.slow
def test_a_hidden_obstacle_is_found_to_a_third_of_its_width() -> None:
    case = OwnRope(
        seed=304, hidden=(Chosen(effect="hidden_obstacle", size=1.0),), plan=PushDesign(episodes=6, pushes=8)
    )
    effect = case.world.effects[0]["parameters"]
    true = np.array([effect[name]["value"] for name in ("obstacle_x", "obstacle_y")])
    study, subject = case.record(), subject_of(case.task)
    predictor = Predictor(subject, catalogue(subject.rods))
    trials = prepare(study, subject)
    about = refit(predictor, trials)
    screening = screen(predictor, trials, about, only=["hidden_obstacle"])
    at = [dict(step.given) for step in screening.steps if step.cause == "hidden_obstacle"]
    places = np.array([list(place.values()) for place in at])
    assert len(places) == KEPT
    assert np.linalg.norm(places[0] - true) < 0.015
