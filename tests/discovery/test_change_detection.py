"""The watch raises a false alarm no more often than it says, whatever the errors' distribution, and notices changes."""

from collections.abc import Callable

import numpy as np
import pytest
from jaxtyping import Float64

from app.discovery.monitor.change_detection import FALSE_ALARM, FIRST, Watch
from app.discovery.monitor.push_residual import Glance

SEQUENCES, PUSHES = 800, 30
Errors = Callable[[np.random.Generator, tuple[int, int]], Float64[np.ndarray, "K T"]]
DISTRIBUTIONS: dict[str, Errors] = {
    "normal": lambda rng, size: np.abs(1 + 0.3 * rng.normal(size=size)),
    "exponential": lambda rng, size: rng.exponential(size=size),
    "log-normal": lambda rng, size: rng.lognormal(-0.32, 0.8, size=size),
    "Pareto without a variance": lambda rng, size: (0.1 + rng.pareto(1.5, size=size)) / 2.1,
    "outliers": lambda rng, size: np.where(rng.random(size) < 0.05, 20.0, 1.0) * rng.uniform(0.2, 0.6, size),
}


def glanced(error_mm: float, promised_mm: float = float("nan")) -> Glance:
    """A push that was predicted to move the object by 20 mm."""
    zero = np.zeros(2)
    return Glance(
        error_m=1e-3 * error_mm,
        moved_m=0.02,
        noise_m=0.001,
        promised_m=1e-3 * promised_mm,
        residual_m=zero,
        place_m=zero,
        ahead=np.array([1.0, 0.0]),
        strayed_m=zero,
        late_s=0.0,
    )


def watched(errors_mm: Float64[np.ndarray, " T"], promised_mm: float = float("nan")) -> Watch:
    watch = Watch()
    for error_mm in errors_mm:
        watch = watch.after(glanced(float(error_mm), promised_mm))
        if watch.alarmed:
            return watch
    return watch


def wilson_high(successes: int, trials: int, z: float = 1.96) -> float:
    """The upper end of Wilson's 95 % interval of a share."""
    share = successes / trials
    middle = share + z**2 / (2 * trials)
    return float((middle + z * np.sqrt(share * (1 - share) / trials + (z / (2 * trials)) ** 2)) / (1 + z**2 / trials))


def test_a_right_model_is_accused_no_more_often_than_stated() -> None:
    """Both parts of the test bet at once: against the first pushes, and against a promise that is kept in the mean."""
    rng, alarms = np.random.default_rng(0), 0
    for errors in DISTRIBUTIONS.values():
        alarms += sum(watched(row, promised_mm=1.0).alarmed > 0 for row in errors(rng, (SEQUENCES, PUSHES)))
    assert wilson_high(alarms, SEQUENCES * len(DISTRIBUTIONS)) <= FALSE_ALARM


@pytest.mark.parametrize(("deviations", "right", "within"), [(2.0, 20, 30), (4.0, FIRST, 8), (4.0, 30, 10)])
def test_a_shift_of_so_many_standard_deviations_is_noticed_within_so_many_pushes(
    deviations: float, right: int, within: int
) -> None:
    rng = np.random.default_rng(1)
    noticed = 0
    for _ in range(100):
        errors = 3 + rng.normal(size=right + within)
        errors[right:] += deviations
        alarmed = watched(np.abs(errors)).alarmed
        noticed += alarmed > right
    assert noticed / 100 > 0.6


def test_a_model_that_errs_four_times_as_much_as_it_said_is_noticed_without_any_right_push() -> None:
    rng = np.random.default_rng(2)
    alarmed = np.array([watched(rng.exponential(4.0, size=40), promised_mm=1.0).alarmed for _ in range(100)])
    assert np.mean(alarmed > 0) > 0.95
    assert np.median(alarmed[alarmed > 0]) <= 15


def test_the_push_from_which_on_the_model_is_wrong_is_found_within_a_few() -> None:
    rng = np.random.default_rng(3)
    since = []
    for _ in range(100):
        watch = watched(np.concatenate([rng.uniform(1, 2, 20), rng.uniform(5, 6, 30)]))
        assert watch.state == "wrong"
        since.append(watch.since)
        assert len(watch.pushes_in_doubt) == watch.alarmed - watch.since + 1
    assert np.quantile(np.abs(np.array(since) - 21), 0.9) <= 2


def test_an_alarm_stays_raised() -> None:
    watch = Watch()
    for error_mm in [1.0, 2.0] * 10 + [9.0] * 10 + [1.0] * 30:
        watch = watch.after(glanced(error_mm))
    assert 20 < watch.alarmed <= 30
    assert watch.state == "wrong"


def test_nothing_is_said_before_anything_could_have_been_noticed() -> None:
    watch, promised = Watch(), Watch().after(glanced(1.0, promised_mm=1.0))
    assert (watch.state, promised.state) == ("learning", "right")
    for _ in range(FIRST):
        watch = watch.after(glanced(1.0))
        assert watch.state == "learning"
    assert watch.after(glanced(1.0)).state == "right"


def test_a_prediction_that_is_no_number_is_left_out() -> None:
    assert Watch().after(glanced(float("nan"))).glances == ()
