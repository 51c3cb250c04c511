"""Confidence learnt from studies: as right as it says on made-up ones, and none is learnt from shuffled ones."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bench.hidden.calibration import WORLDS, Lines, World, drawn, learnt, left_out, of_other_worlds, said
from bench.hidden.ropes import RopeCase

CAUSES = ("draught", "friction_map", "stribeck", "table_tilt")
COUNT = 1500


def studies(seed: int = 0, *, strength: float = 3.0, shuffled: bool = False) -> Lines:
    """Studies whose evidence for the hidden cause is `strength` above chance; in one of four nothing is hidden."""
    rng = np.random.default_rng(seed)
    true = np.zeros((COUNT, len(CAUSES) + 1))
    true[np.arange(COUNT), rng.integers(0, len(CAUSES) + 1, COUNT)] = 1.0
    evidence = rng.normal(size=(COUNT, len(CAUSES), 1)) + strength * true[:, :-1, None]
    features = np.concatenate([evidence, rng.normal(size=evidence.shape)], axis=2)
    if shuffled:
        true = true[rng.permutation(COUNT)]
    return Lines(causes=CAUSES, features=features, true=true, worlds=worlds(rng))


def worlds(rng: np.random.Generator) -> tuple[World, ...]:
    return tuple(list(WORLDS)[number] for number in rng.integers(len(WORLDS), size=COUNT))


@pytest.mark.parametrize("learnt_elsewhere", [left_out, of_other_worlds])
def test_what_it_says_is_right_as_often_as_it_says_in_studies_that_it_was_not_learnt_from(
    learnt_elsewhere: Callable[[Lines], np.ndarray],
) -> None:
    known = studies()
    found = learnt_elsewhere(known)
    likeliest, right = found.max(1), known.true[np.arange(COUNT), found.argmax(1)] > 0
    for low, high in ((0.4, 0.7), (0.7, 0.9), (0.9, 1.0)):
        own = (likeliest > low) & (likeliest <= high)
        assert right[own].mean() == pytest.approx(likeliest[own].mean(), abs=4 / np.sqrt(own.sum()) / 2)
    assert right.mean() > 0.8


def test_from_shuffled_truths_nothing_is_learnt() -> None:
    known = studies(shuffled=True)
    found = left_out(known)
    assert found.max() < 0.5
    assert (known.true[np.arange(COUNT), found.argmax(1)] > 0).mean() < 0.3


def test_of_two_that_are_hidden_either_is_right() -> None:
    known = studies()
    both = known.true.copy()
    both[:, :2] = both[:, :2].max(1, keepdims=True)
    table = learnt(replace(known, true=both))
    found = said(table, known)[both[:, 0] > 0]
    assert (found[:, :2].sum(1) > 0.5).mean() > 0.7


def test_a_table_that_is_learnt_on_stays_where_studies_say_nothing_and_goes_where_many_do() -> None:
    known = studies()
    before = learnt(replace(known, true=np.roll(known.true, 1, axis=1)))
    few, many = (learnt(known, range(count), before) for count in (0, COUNT))
    np.testing.assert_array_equal(few.weights, before.weights)
    assert few.studies == before.studies
    assert many.studies == before.studies + COUNT
    right = known.true[:, :-1].argmax(1)
    hidden = known.true[:, -1] == 0
    assert (said(many, known)[hidden, :-1].argmax(1) == right[hidden]).mean() > 0.8
    assert (said(before, known)[hidden, :-1].argmax(1) == right[hidden]).mean() < 0.5


def test_a_world_says_nothing_of_itself_in_what_is_learnt_of_the_others() -> None:
    known = studies()
    odd = np.array(known.worlds) == "cable"
    wrong = known.true.copy()
    wrong[odd] = np.roll(wrong[odd], 1, axis=1)
    found = of_other_worlds(replace(known, true=wrong))
    assert np.allclose(found[odd], of_other_worlds(known)[odd])


def test_studies_are_the_same_whatever_others_are_drawn_and_hide_what_can_be_hidden() -> None:
    assert drawn(0, 7) == drawn(0, 7)
    cases = [drawn(0, number) for number in range(300)]
    assert {world for world, _ in cases} == set(WORLDS)
    counts = np.array([len(case.hidden) for _, case in cases])
    assert 0.1 < (counts == 0).mean() < 0.35
    assert 0.02 < (counts == 2).mean() < 0.15
    assert len({each.effect for _, case in cases for each in case.hidden}) > 20
    for _, case in cases:
        if isinstance(case, RopeCase):
            assert len(case.injected) == len(case.hidden)
    assert {each.effect for world, case in cases if world == "cable" for each in case.hidden} <= _ARM


_ARM = {
    "actuator_lag",
    "backlash",
    "command_delay",
    "tcp_offset",
    "tool_compliance",
    "under_reach",
    "camera_time_offset",
}
"""Effects that can be hidden in a world whose rope no effect acts on, and whose cameras show no images."""
