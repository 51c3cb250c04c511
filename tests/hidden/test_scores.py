"""Shares, intervals, sizes and curves of outcomes that are known."""

import json
import math

import numpy as np
import pytest

from app.evaluation.intervals import median, share
from app.report import verdict_json
from bench.hidden.curves import calibration_error, confusion, confusion_of_classes, power, reliability
from bench.hidden.draws import Case, Chosen
from bench.hidden.figures import confusion_svg, power_svg, reliability_svg
from bench.hidden.outcome import CLASSES, Outcome, Truth, outcome, size_of
from bench.hidden.scores import SURE_WRONG, alarming, covered, of_family, rows, size_error
from bench.hidden.tables import family_cells
from tests.hidden import synthetic
from tests.hidden.synthetic import blamed, line
from tests.ui.report.cases import CASES


def made(hidden: list[tuple[str, float]], kind: str, causes: list[dict], ranking: list[dict] | None = None) -> Outcome:
    chosen = tuple(Chosen(effect=name, size=size) for name, size in hidden)
    return outcome(line(Case(number=0, world="own", hidden=chosen), (kind, causes, ranking or causes)))


@pytest.mark.parametrize("name", CASES)
def test_a_real_verdict_is_read_as_it_is_written(name: str) -> None:
    case = CASES[name]()
    hidden = Case(number=0, world="own", hidden=(Chosen(effect="backlash", size=1.0),))
    read = outcome(line(hidden, ("none", [], [])) | {"verdict": json.loads(verdict_json(case))})
    assert read.verdict == case.verdict
    assert [cause.effect for cause in read.causes] == [blame.effect for blame in case.causes]
    assert [cause.probability for cause in read.ranking] == [blame.probability for blame in case.ranking]
    assert (read.nominal_mm, read.extended_mm) == (case.gain.nominal_mm, case.gain.extended_mm)
    assert read.whole_s == pytest.approx(sum(seconds for _, seconds in case.spent_s))


def test_the_screening_verdict_takes_all_stages_up_to_it() -> None:
    read = made([], "none", [])
    assert (read.screening_s, read.whole_s) == (60.0, 160.0)


def test_wilsons_interval_is_that_of_the_textbook() -> None:
    """Brown, Cai and DasGupta 2001, "Interval estimation for a binomial proportion"."""
    assert share([True] * 10) == pytest.approx((1.0, 0.722, 1.0, 10), abs=1e-3)
    assert share([True] * 5 + [False] * 5) == pytest.approx((0.5, 0.237, 0.763, 10), abs=1e-3)
    assert share([]).n == 0


def test_the_interval_of_a_median_holds_the_true_one_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    inside = [found.low <= 0 <= found.high for found in (median(rng.normal(size=25)) for _ in range(400))]
    assert 0.92 < np.mean(inside) < 0.99


def test_a_size_is_the_value_of_one_switch_and_the_length_of_several() -> None:
    def parameter(value: float, unit: str, null: float = 0.0) -> dict:
        return {"value": value, "unit": unit, "null": null}

    assert size_of([parameter(-0.6, "1", 0.3), parameter(0.5, "m")]) == (-0.6, 0.3)
    assert size_of([parameter(3.0, "m"), parameter(-4.0, "m")]) == (5.0, 0.0)


def test_a_size_of_the_wrong_sign_is_wrong_by_more_than_itself() -> None:
    good = made([("depth_scale", 1.0)], "named", [blamed("depth_scale", 0.9, 1.1)])
    wrong = made([("depth_scale", 1.0)], "named", [blamed("depth_scale", 0.9, -1.0)])
    assert size_error(good) == pytest.approx(0.1)
    assert size_error(wrong) == pytest.approx(2.0)
    assert math.isnan(size_error(made([("depth_scale", 1.0)], "named", [blamed("depth_bias", 0.9)])))


def test_of_what_acts_along_the_object_the_sign_says_nothing() -> None:
    turned = made([("rest_curvature", 1.0)], "named", [blamed("rest_curvature", 0.9, -1.0)])
    assert size_error(turned) == pytest.approx(0.0)
    assert covered(turned.truths[0], turned.causes[0])


@pytest.mark.parametrize(("size", "inside"), [(1.1, True), (1.4, False), (-1.0, False)])
def test_an_interval_covers_the_true_size_or_not(size: float, inside: bool) -> None:
    truth = Truth(effect="depth_scale", category="sensing", typical=1.0, size=1.0, null=0.0)
    case = made([("depth_scale", 1.0)], "named", [blamed("depth_scale", 0.9, size)])
    assert covered(truth, case.causes[0]) is inside


def test_an_error_of_our_own_numerics_is_no_false_alarm() -> None:
    assert not alarming(made([], "named", [blamed("resolution", 0.9)]))
    assert alarming(made([], "set", [blamed("resolution", 0.5), blamed("depth_scale", 0.4)]))


def test_probabilities_that_hold_have_no_calibration_error_and_boasting_has_one() -> None:
    def stated(probability: float, hits: int) -> list[Outcome]:
        right = [made([("backlash", 1.0)], "set", [blamed("backlash", probability)])] * hits
        return right + [made([("tcp_offset", 1.0)], "set", [blamed("backlash", probability)])] * (10 - hits)

    assert calibration_error(reliability(stated(0.9, 9) + stated(0.3, 3))) == pytest.approx(0.0, abs=1e-9)
    assert calibration_error(reliability(stated(0.9, 5))) == pytest.approx(0.4)


def test_confusions_count_each_case_with_one_thing_or_nothing_hidden() -> None:
    outcomes = synthetic.outcomes(synthetic.good)
    singles = sum(len(each.truths) < 2 for each in outcomes)
    for matrix in (confusion(outcomes), confusion_of_classes(outcomes)):
        assert matrix.counts.sum() == singles
        assert np.trace(matrix.counts) / singles == pytest.approx(0.95, abs=0.04)


def test_power_rises_from_nothing_to_all_where_large_ones_alone_are_named() -> None:
    def only_large(case, rng):
        large = bool(case.hidden) and case.hidden[0].size >= 1
        return synthetic.good(case, rng) if large else synthetic.never(case, rng)

    powers = power(synthetic.outcomes(only_large))
    assert max(each.named.value for each in powers if each.high <= 1) == 0
    assert np.mean([each.named.value for each in powers if each.low >= 1]) > 0.8


def test_figures_are_drawings_with_a_mark_for_everything_counted() -> None:
    outcomes = synthetic.outcomes(synthetic.good, count=100)
    bins, powers, matrix = reliability(outcomes), power(outcomes), confusion(outcomes)
    drawn = confusion_svg(matrix), reliability_svg(bins), power_svg(powers)
    assert all(text.startswith("<svg") and text.rstrip().endswith("</svg>") for text in drawn)
    assert drawn[1].count("<circle") == sum(each.right.n > 0 for each in bins)
    assert drawn[2].count("<circle") == len(powers)


def test_a_row_without_a_case_is_neither_met_nor_missed() -> None:
    assert all(row.met is None for row in rows([]))


def test_every_case_with_one_effect_is_of_one_family_and_a_good_solver_is_good_in_each() -> None:
    outcomes = synthetic.outcomes(synthetic.good)
    singles = [each for each in outcomes if each.single]
    assert sum(len(of_family(outcomes, category)) for category in CLASSES) == len(singles)
    head, *cells = family_cells(outcomes)
    assert head[1:] == list(CLASSES[:5])
    (first,) = [row for row in cells if row[0].startswith("first is right")]
    assert all(int(cell.split("%")[0]) >= 85 for cell in first[1:])


def test_a_name_beside_the_right_one_is_wrong_with_confidence_and_one_in_a_set_is_not() -> None:
    def wrong(hidden: list[tuple[str, float]], kind: str, causes: list[dict]) -> float:
        found = rows([made(hidden, kind, causes)])
        return next(row.measured.value for row in found if row.target.name == SURE_WRONG)

    right, other = blamed("backlash", 0.95), blamed("table_tilt", 0.92)
    assert wrong([("backlash", 1.0)], "named", [right]) == 0
    assert wrong([("backlash", 1.0)], "named", [right, other]) == 1
    assert wrong([], "named", [other]) == 1
    assert wrong([], "set", [blamed("table_tilt", 0.7), blamed("draught", 0.2)]) == 0
