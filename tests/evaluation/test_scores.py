"""Scores over many episodes: known rows give known scores."""

from pathlib import Path

import numpy as np
import pytest

from app.evaluation.curves import draw
from app.evaluation.intervals import mean
from app.evaluation.scores import scores
from app.evaluation.tables import markdown


def row(planner: str, ablation: str, seed: int, end_m2: float | None, **said: object) -> dict[str, object]:
    chamfers = [] if end_m2 is None else [1e-2, end_m2]
    return {
        "task": "rope_push",
        "planner": planner,
        "ablation": ablation,
        "seed": seed,
        "chamfer_m2": end_m2,
        "success": True,
        "reward": 1.0,
        "failure": "",
        "chamfers_m2": chamfers,
        "decisions_s": [1.0, 2.0],
        **said,
    }


def evaluated() -> list[dict[str, object]]:
    """Ten seeds; the baseline ends 100 mm^2 farther from each goal, but for one that failed before it saw anything."""
    ends = np.linspace(1e-4, 4e-4, 10)
    whole = [row("dipac", "none", seed, float(end)) for seed, end in enumerate(ends)]
    other = [row("cem_mpc", "none", seed, float(end) + 1e-4, success=seed < 5) for seed, end in enumerate(ends)]
    other[9] = row("cem_mpc", "none", 9, None, success=False, failure="nothing was seen", decisions_s=[])
    return other + whole


def test_the_whole_planner_comes_first_and_the_others_are_compared_seed_by_seed() -> None:
    whole, other = scores(evaluated())
    assert (whole.planner, other.planner) == ("dipac", "cem_mpc")
    assert whole.chamfer_m2.value == pytest.approx(2.5e-4)
    assert whole.chamfer_m2.low < 2.5e-4 < whole.chamfer_m2.high
    assert whole.worse_m2.n == 0
    # The same difference in every seed has no spread, however far apart the seeds are.
    assert tuple(other.worse_m2) == pytest.approx((1e-4, 1e-4, 1e-4, 9))


def test_intervals_of_a_mean_cover_it_as_often_as_they_say_and_few_values_have_none() -> None:
    rng = np.random.default_rng(0)
    for n in (4, 10):
        found = [mean(values) for values in rng.standard_normal((2000, n))]
        assert 0.93 < np.mean([one.low < 0.0 < one.high for one in found]) < 0.97
    assert np.isnan([mean([1.0, 2.0, 3.0]).low, mean([1.0]).high]).all()
    assert mean([1.0, np.nan, 3.0]).value == 2.0


def test_failures_are_counted_as_episodes_without_success() -> None:
    _, other = scores(evaluated())
    assert (other.episodes, other.failed) == (10, 1)
    assert other.success.value == 0.5
    assert other.success.n == 10


def test_the_table_says_what_was_measured_in_square_millimetres(tmp_path: Path) -> None:
    text = markdown(scores(evaluated()))
    assert "## rope_push" in text
    assert "| dipac | 10 | 0 | 100% (72.2 to 100) | 250 (" in text
    assert "| 100 (100 to 100) |" in text
    (path,) = draw(evaluated(), tmp_path)
    assert path.name == "rope_push-chamfer.svg"
    assert "cem_mpc (n = 9)" in path.read_text()
