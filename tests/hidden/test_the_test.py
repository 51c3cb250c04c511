"""The suite itself: a good solver passes it, and one that guesses, parrots or skips a step of inference does not."""

from collections.abc import Callable

import numpy as np
import pytest

from app.discovery.inference.decide import TEMPERATURE
from app.discovery.inference.weighing import CALIBRATED, Prior, weigh
from app.discovery.residuals.rows import Block, Residuals
from bench.hidden.draws import Case, Chosen, kinds
from bench.hidden.outcome import ACTUATION, SENSING, Outcome, category_of, outcome
from bench.hidden.scores import ALARMS, CONFIDENT, SURE_WRONG, Row, passes, rows
from tests.hidden import synthetic
from tests.hidden.synthetic import Told, blamed, line

FIRST = "physics: first is right, at >= 1x typical"
FIRST_OF_APPARATUS = "cameras and arm: first is right, at >= 1x typical"


def row(outcomes: list[Outcome], name: str) -> Row:
    return next(row for row in rows(outcomes) if row.target.name == name and row.world == "own")


def test_a_good_solver_meets_every_target_that_has_cases() -> None:
    outcomes = synthetic.outcomes(synthetic.good)
    assert [row.target.name for row in rows(outcomes) if row.met is False] == []
    assert all(row.measured.n for row in rows(outcomes) if row.world == "own")
    assert passes(outcomes)


@pytest.mark.parametrize(
    ("solver", "missed"),
    [
        (synthetic.guessing, {ALARMS, FIRST, FIRST_OF_APPARATUS, SURE_WRONG, "expected calibration error"}),
        (synthetic.always_friction, {ALARMS, FIRST, FIRST_OF_APPARATUS, SURE_WRONG, "expected calibration error"}),
        (synthetic.never, {FIRST, FIRST_OF_APPARATUS, "outside the catalogue: says so"}),
    ],
)
def test_a_solver_that_does_not_look_fails(solver: synthetic.Solver, missed: set[str]) -> None:
    outcomes = synthetic.outcomes(solver)
    assert not passes(outcomes)
    assert missed <= {row.target.name for row in rows(outcomes) if row.met is False}


def test_scored_by_the_truths_of_others_a_good_solver_is_at_chance() -> None:
    scored = row(synthetic.outcomes(synthetic.good, shuffled=True), FIRST).measured
    # One verdict in two says a cause of the catalogue alone, one in seven two of them.
    assert scored.low <= 0.65 / len(kinds("own")) <= scored.high
    assert scored.high < 0.15


def test_a_name_that_is_wrong_in_every_fifth_case_is_too_many() -> None:
    def sloppy(case: Case, rng: np.random.Generator) -> Told:
        told = synthetic.good(case, rng)
        return synthetic.guessing(case, rng) if rng.uniform() < 0.2 else told

    assert not passes(synthetic.outcomes(sloppy))


K, R, CAUSES = 48, 12, 8
NAMES = [name for name in kinds("own") if category_of(name, synthetic.FAMILIES[name]) not in (ACTUATION, SENSING)][
    :CAUSES
]
"""Effects that are neither of the actuation nor of the sensing: the causes in the linear world."""
HABIT = 0.02
"""Prior standard deviation of each cause where nothing is missing, in steps."""
CAMERA_M = 3e-4
World = tuple[Case, Residuals]
Inference = Callable[[Residuals], np.ndarray]


def linear_world(number: int) -> World:
    """Pushes whose residuals are linear in friction, stiffness and eight causes, of which two look like them.

    Friction and stiffness are off by up to 30 %, which is one step. Noise is of 2 mm and shared by neighbouring modes.
    """
    rng = np.random.default_rng([3, number])
    J = 1e-3 * rng.normal(size=(K, R, 2 + CAUSES))
    J[:, :, :2] *= 3
    J[:, :, 2:4] += 0.7 * J[:, :, :2]
    theta = np.zeros(2 + CAUSES)
    theta[:2] = rng.uniform(-1, 1, 2)
    hidden = list[Chosen]()
    if number % 4:
        cause, size = int(rng.integers(CAUSES)), float(np.exp(rng.uniform(np.log(0.25), np.log(2))))
        theta[2 + cause] = size
        hidden.append(Chosen(effect=NAMES[cause], size=size))
    root = np.linalg.cholesky(4e-6 * np.exp(-np.abs(np.subtract.outer(np.arange(R), np.arange(R))) / 6))
    data = Residuals(
        r=J @ theta + rng.normal(size=(K, R)) @ root.T,
        J=J,
        spread=np.zeros((K, R, 4)),
        known=np.ones((K, R), bool),
        episode=np.arange(K) // 6,
        blocks=(Block(slice(0, R)),),
    )
    return Case(number=number, world="own", hidden=tuple(hidden)), data


def prior(nuisance: float) -> Prior:
    return Prior(
        mean=np.zeros(2 + CAUSES),
        variance=np.array([nuisance**2] * 2 + [HABIT**2] * CAUSES),
        nuisance=(0, 1),
    )


def whole(data: Residuals) -> np.ndarray:
    """The inference as it is."""
    return np.array([found.log_bayes for found in weighed(data, CALIBRATED)])


def without_projection(data: Residuals) -> np.ndarray:
    """An inference that holds friction and stiffness at their nominal values."""
    return np.array([found.log_bayes for found in weighed(data, 1e-4)])


def without_noise(data: Residuals) -> np.ndarray:
    """An inference whose noise is that of a camera in one mode, instead of the scatter of these residuals."""
    J, r = data.J.reshape(-1, 2 + CAUSES) / CAMERA_M, data.r.ravel() / CAMERA_M

    def evidence(variance: np.ndarray) -> float:
        precision = J.T @ J + np.diag(1 / variance)
        pull = J.T @ r
        occam = np.log(variance).sum() + np.linalg.slogdet(precision)[1]
        return 0.5 * float(pull @ np.linalg.solve(precision, pull) - occam)

    alone = prior(CALIBRATED)
    return np.array([evidence(alone.wider([2 + at]).variance) - evidence(alone.variance) for at in range(CAUSES)])


def weighed(data: Residuals, nuisance: float):
    return weigh(data, [[2 + at] for at in range(CAUSES)], prior(nuisance)).findings


def concluded(log_bayes: np.ndarray) -> Told:
    """A verdict of evidence alone: one name above a probability of 0.8, or none."""
    logs = np.array([np.log(0.25), *(np.log(0.75 / CAUSES) + log_bayes / TEMPERATURE)])
    chances = np.exp(logs - logs.max())
    chances /= chances.sum()
    order = np.argsort(-chances[1:])
    ranking = [blamed(NAMES[at], float(chances[1 + at])) for at in order]
    sure = ranking[0]["probability"] > CONFIDENT
    return "named" if sure else "none", ranking[: int(sure)], ranking


def judged(inference: Inference, count: int = 28) -> list[Outcome]:
    worlds = map(linear_world, range(count))
    return [outcome(line(case, concluded(inference(data)))) for case, data in worlds]


def test_the_inference_raises_no_false_alarm_and_finds_causes_where_all_is_linear() -> None:
    outcomes = judged(whole)
    assert row(outcomes, ALARMS).met
    assert row(outcomes, FIRST).met


@pytest.mark.parametrize("skipping", [without_projection, without_noise])
def test_an_inference_that_skips_the_projection_or_the_noise_fails_by_false_alarms(skipping: Inference) -> None:
    outcomes = judged(skipping)
    assert row(outcomes, ALARMS).met is False
    assert not passes(outcomes)
