"""Own worlds: everything that can be hidden is, at the size that was asked for, and nothing else is."""

import numpy as np
import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from bench.hidden.draws import Making, kinds, outsiders
from bench.hidden.outside import OUTSIDE
from bench.hidden.own import Order, World, world_of

KNOWN, SUBJECT = catalogue(), subject_of(load("rope_push"))
POINTS = Making(dynamics="mpm")


def world(*hidden: tuple[str, float], seed: int = 4) -> World:
    return world_of(Order(name="any", seed=seed, hidden=hidden), KNOWN, SUBJECT)


@pytest.mark.parametrize("size", [0.25, 1.0])
@pytest.mark.parametrize("name", kinds("own", POINTS))
def test_an_effect_has_the_size_that_was_asked_for_and_no_other_is_there(name: str, size: float) -> None:
    made, nominal, cause = world((name, size)), KNOWN.nominal(SUBJECT), KNOWN.cause(name)
    shares = list[float]()
    for column in cause.columns[: cause.switches]:
        spec = KNOWN.specs[column]
        assert spec.typical is not None
        null = spec.coordinate(spec.nominal)
        shares.append((spec.coordinate(made.theta[column]) - null) / (spec.coordinate(spec.typical) - null))
    assert np.linalg.norm(shares) == pytest.approx(size)
    own = {*cause.columns, *(KNOWN.column(calibrated) for calibrated in SUBJECT.calibrated)}
    others = [column for column in range(len(nominal)) if column not in own]
    np.testing.assert_array_equal(made.theta[others], nominal[others])
    assert [effect["effect"] for effect in made.effects] == [name]


@pytest.mark.parametrize("name", outsiders("own", POINTS))
def test_what_no_catalogue_has_leaves_everything_in_it_alone(name: str) -> None:
    made, nominal = world((name, 1.0)), KNOWN.nominal(SUBJECT)
    calibrated = [KNOWN.column(each) for each in SUBJECT.calibrated]
    others = np.setdiff1d(np.arange(len(nominal)), calibrated)
    np.testing.assert_array_equal(made.theta[others], nominal[others])
    specs = [spec for effect in OUTSIDE.values() for spec in effect.parameters]
    changed = {spec.name for spec, value in zip(specs, made.beyond, strict=True) if value != spec.nominal}
    assert changed == {spec.name for spec in OUTSIDE[name].parameters}
    assert made.effects[0]["catalogued"] is False


def test_friction_and_stiffness_are_off_by_up_to_a_third_also_where_nothing_is_hidden() -> None:
    nominal = KNOWN.nominal(SUBJECT)
    columns = [KNOWN.column(name) for name in SUBJECT.calibrated]
    ratios = np.array([world(seed=seed).theta[columns] / nominal[columns] for seed in range(40)])
    assert 0.7 <= ratios.min() < 0.75
    assert 1.25 < ratios.max() <= 1.3
    assert world().effects == []
