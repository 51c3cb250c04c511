"""Other methods, where all is linear: they find what is large, and say nothing where nothing is there."""

import numpy as np
import pytest

from app.discovery.inference.screen import CandidateCause
from app.discovery.inference.weighing import HypothesisResult
from app.discovery.residuals.sensitivity import Step
from bench.hidden.baselines import Fitted, Linear, all_at_once, bic

ROWS, CAUSES = 600, 8
TRUE = 5
SIZE = 1.2


def linear(size: float, seed: int = 0) -> Linear:
    """Two nuisances and eight causes of one column each, noise of unit size, one cause there."""
    rng = np.random.default_rng(seed)
    J = 0.3 * rng.normal(size=(ROWS, 2 + CAUSES))
    J[:, 2:4] += J[:, :2]
    theta = np.zeros(2 + CAUSES)
    theta[:2], theta[2 + TRUE] = (0.7, -0.4), size
    r = J @ theta + rng.normal(size=ROWS)
    suspects = tuple(
        CandidateCause(
            cause=f"cause{at}",
            columns=(2 + at,),
            steps=(Step(cause=f"cause{at}", column=2 + at, size=1.0, sides=2),),
            finding=HypothesisResult(0.0, np.zeros(1), np.eye(1)),
        )
        for at in range(CAUSES)
    )
    return Linear(A=J.T @ J, b=J.T @ r, c=float(r @ r), n=ROWS, nuisance=(0, 1), suspects=suspects)


def first(fits: list[Fitted]) -> tuple[str, float]:
    return fits[0].suspect.cause, float(fits[0].values[0])


@pytest.mark.parametrize("method", [all_at_once, bic])
def test_what_is_large_is_named_with_its_size(method) -> None:
    kind, causes, fits = method(linear(SIZE))
    assert (kind, causes) == ("named", [f"cause{TRUE}"])
    name, size = first(fits)
    assert name == f"cause{TRUE}"
    assert size == pytest.approx(SIZE, abs=4 * float(fits[0].deviations[0]))
    assert len(fits) == CAUSES


@pytest.mark.parametrize("method", [all_at_once, bic])
def test_where_nothing_is_nothing_is_named(method) -> None:
    kinds = [method(linear(0.0, seed))[0] for seed in range(5)]
    assert kinds.count("none") >= 4


def test_the_search_finds_the_least_squares_within_its_bounds() -> None:
    data = linear(SIZE)
    _, _, fits = all_at_once(data)
    whole, _, _ = data.fit(range(2 + CAUSES))
    found = {fit.suspect.cause: float(fit.values[0]) for fit in fits}
    np.testing.assert_allclose([found[f"cause{at}"] for at in range(CAUSES)], whole[2:], atol=2e-3)


def test_probabilities_of_single_causes_and_nothing_are_one() -> None:
    _, _, fits = bic(linear(0.3))
    assert 0 < sum(fit.probability for fit in fits) <= 1 + 1e-9
    assert [fit.probability for fit in fits] == sorted((fit.probability for fit in fits), reverse=True)
