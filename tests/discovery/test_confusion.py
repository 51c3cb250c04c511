"""Confusions that pushes would leave: causes with the same slopes, and no others; too weak a cause stays unseen."""

import numpy as np
import pytest

from app.discovery.inference.confusion import confusions
from app.discovery.inference.decide import likeliest_cause
from app.discovery.inference.weighing import HypothesisResult, weigh
from app.discovery.residuals.rows import Residuals
from tests.discovery.made_up import ALL, CAUSES, K, R, screening


def test_what_has_slopes_of_its_own_is_told_apart() -> None:
    found = confusions(screening(lambda rng: rng.normal(size=(K, R, 4))), CAUSES)
    assert np.diag(found).min() > 0.95
    assert (found.sum(1) <= 1 + 1e-9).all()


def test_what_has_the_same_slopes_is_confused_evenly() -> None:
    def alike(rng: np.random.Generator) -> np.ndarray:
        J = rng.normal(size=(K, R, 4))
        J[:, :, 1] = J[:, :, 0] + 0.02 * rng.normal(size=(K, R))
        return J

    found = confusions(screening(alike), CAUSES)
    assert found[:2, :2] == pytest.approx(0.5, abs=0.2)
    assert np.diag(found)[2:].min() > 0.95


def test_what_is_too_weak_for_these_pushes_stays_unseen() -> None:
    found = confusions(screening(lambda rng: rng.normal(size=(K, R, 4)) * [1.0, 1.0, 1.0, 0.005]), CAUSES)
    assert found[3].sum() < 0.05
    assert np.diag(found)[:3].min() > 0.95


def test_it_agrees_with_looking_for_causes_in_made_up_residuals() -> None:
    """Confusion of a cause that is half seen: the whole inference names it 30 times of 60, the linear bootstrap 80 %.

    Student's t counts on wider noise than these residuals have, which makes the bootstrap a little too hopeful.
    """
    about = screening(lambda rng: rng.normal(size=(K, R, 4)) * [1.0, 1.0, 1.0, 0.08])
    rng, named = np.random.default_rng(1), 0
    for _ in range(60):
        r = about.data.J @ np.array([0.0, *rng.normal(0, 0.05, 3), rng.choice([-1.0, 1.0])])
        data = about.data.of(np.arange(K))
        findings = weigh(_with(data, r + 1e-3 * rng.normal(size=(K, R))), ALL, about.prior).findings
        named += _first(findings) == 3
    share = confusions(about, CAUSES)[3, 3]
    assert 0.1 < share < 0.9
    assert named / 60 == pytest.approx(share, abs=0.35)


def _with(data: Residuals, r: np.ndarray) -> Residuals:
    return Residuals(r=r, J=data.J, spread=data.spread, known=data.known, episode=data.episode, blocks=data.blocks)


def _first(findings: tuple[HypothesisResult, ...]) -> int | None:
    """The likeliest cause; None where the null hypothesis is likelier."""
    logs = {str(n): finding.log_bayes for n, finding in enumerate(findings)}
    found = likeliest_cause(logs)
    return int(found) if found is not None else None
