"""Test of unexplained residuals: it finds little where only chance is, and nearly always finds what is there."""

import numpy as np
import pytest

from app.discovery.inference.mixed_effects import QuadraticForms
from app.discovery.inference.weighing import Prior, weigh
from app.discovery.residuals.forces import FEATURES, parameters
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.unexplained.basis_functions import Widened
from app.discovery.unexplained.residual_test import (
    LEFT,
    ResidualTest,
    by_chance,
    leftover,
    project_onto,
    something_left,
)

EPISODES, PUSHES, ROWS = 8, 4, 12
NUISANCES, HABIT = 3, 0.15
NAMES = parameters()
AT = {feature: tuple(NUISANCES + NAMES.index(name) for name in own) for feature, own in FEATURES.items()}


def widened(
    seed: int, *, swirl: float = 0.0, heavy: bool = False, episodes: int = EPISODES, null_prior: float = HABIT
) -> Widened:
    """Pushes with errors of 2 mm that are alike within an episode, features that act by a millimetre, and a swirl."""
    rng = np.random.default_rng(seed)
    count, width = episodes * PUSHES, NUISANCES + len(NAMES)
    J = 1e-3 * rng.normal(size=(count, ROWS, width))
    noise = rng.standard_t(3, (count, ROWS)) if heavy else rng.normal(size=(count, ROWS))
    theta = np.zeros(width)
    theta[:NUISANCES] = rng.normal(size=NUISANCES)
    theta[NUISANCES + NAMES.index("swirl")] = swirl
    data = Residuals(
        r=J @ theta + 2e-3 * noise,
        J=J,
        spread=np.zeros((count, ROWS, 1)),
        known=np.ones((count, ROWS), bool),
        episode=np.arange(count) // PUSHES,
        blocks=(Block(slice(0, ROWS)),),
    )
    variance = np.full(width, null_prior**2)
    variance[:NUISANCES] = 100.0
    prior = Prior(mean=np.zeros(width), variance=variance, nuisance=tuple(range(NUISANCES)))
    return Widened(data=data, prior=prior, weighing=weigh(data, list(AT.values()), prior), at=AT)


def found(seed: int, swirl: float) -> ResidualTest:
    return leftover(widened(seed, swirl=swirl))


@pytest.mark.parametrize("heavy", [False, True], ids=["normal", "heavy tails"])
def test_where_nothing_is_left_little_is_found(heavy: bool) -> None:
    alarms = [leftover(widened(seed, heavy=heavy)).probability > LEFT for seed in range(12)]
    assert sum(alarms) <= 1


def test_where_something_is_left_it_is_found() -> None:
    assert all(found(seed, swirl=2.0).probability > LEFT for seed in range(5))


def test_few_episodes_cannot_exclude_chance() -> None:
    left = leftover(widened(0, swirl=3.0, episodes=4))
    assert left.by_chance > 2**-5
    assert left.probability < LEFT


def test_by_chance_is_even_where_only_chance_is() -> None:
    rng = np.random.default_rng(1)
    shares = list[float]()
    for seed in range(100):
        J = rng.normal(size=(EPISODES, 30, len(NAMES)))
        forms = forms_of(J, rng.normal(size=(EPISODES, 30)))
        prior = Prior(mean=np.zeros(len(NAMES)), variance=np.full(len(NAMES), 1e-6), nuisance=())
        scores = project_onto(forms, prior, range(len(NAMES)))
        groups = [[NAMES.index(name) for name in own] for own in FEATURES.values()]
        shares.append(by_chance(scores, groups, np.zeros(len(NAMES)), seed))
    assert 0.35 < np.mean(shares) < 0.65
    assert np.mean(np.array(shares) < 0.1) < 0.2


def forms_of(J: np.ndarray, r: np.ndarray) -> QuadraticForms:
    """Quadratic forms of errors of unit size: J (E, R, F), r (E, R)."""
    return QuadraticForms(np.einsum("erp,erq->epq", J, J), np.einsum("erp,er->ep", J, r), np.arange(len(J)))


def test_what_the_simulators_own_errors_look_like_is_not_something_else() -> None:
    habitual, strange = (widened(3, swirl=0.3, null_prior=null_prior) for null_prior in (1.0, 1e-6))
    assert leftover(habitual).by_chance > leftover(strange).by_chance


def test_no_evidence_leaves_what_was_believed_before() -> None:
    assert something_left([0.0, 0.0]) == pytest.approx(0.25)
    assert something_left([40.0, 0.0]) > LEFT
    assert something_left([-50.0, -50.0]) < 1e-3
