"""Draws of hidden effects: by the stated shares, and fully determined by a number and a seed."""

import numpy as np
import pytest

from app.jobs.discovery_subject import subject_of
from app.tasks import load
from bench.hidden.draws import (
    BODIES,
    NONE,
    SIZES,
    TWO,
    UNKNOWN,
    WORLDS,
    CaseDistribution,
    Making,
    drawn,
    kinds,
    outsiders,
    real_size,
)

COUNT = 2000
BLIND = Making(images=False)
BEANS = Making(dynamics="mpm", images=False, task="bean_sweep")
CLOTH = Making(dynamics="mpm", task="cloth_hang")


@pytest.mark.parametrize("world", WORLDS)
def test_shares_are_those_that_discovery_states(world) -> None:
    cases = [drawn(5, number, world) for number in range(COUNT)]
    strange = [any(each.effect in outsiders(world) for each in case.hidden) for case in cases]
    two = [len(case.hidden) == 2 for case in cases]
    none = [not case.hidden for case in cases]
    for share, drawn_so in ((NONE, none), (TWO, two), (UNKNOWN, strange)):
        assert np.mean(drawn_so) == pytest.approx(share, abs=0.03)
    assert (NONE, TWO, UNKNOWN) == (0.25, 0.15, 0.15)


@pytest.mark.parametrize("world", WORLDS)
def test_every_kind_comes_up_and_sizes_are_even_on_a_logarithmic_scale(world) -> None:
    hidden = [each for number in range(COUNT) for each in drawn(5, number, world).hidden]
    assert {each.effect for each in hidden} == {*kinds(world), *outsiders(world)}
    logs = np.log([each.size for each in hidden])
    assert np.log(SIZES[0]) <= logs.min() < logs.max() <= np.log(SIZES[1])
    assert np.median(logs) == pytest.approx(np.mean(np.log(SIZES)), abs=0.08)


def test_a_case_depends_on_nothing_but_its_seed_number_and_world() -> None:
    first = [drawn(5, number, "own") for number in range(50)]
    assert [drawn(5, number, "own") for number in reversed(range(50))] == first[::-1]
    assert [drawn(6, number, "own") for number in range(50)] != first
    assert [drawn(5, number, "mujoco").hidden for number in range(50)] != [case.hidden for case in first]


def test_both_worlds_hide_more_than_twenty_kinds_and_some_that_no_catalogue_has() -> None:
    assert all(len(kinds(world)) > 20 and len(outsiders(world)) >= 3 for world in WORLDS)
    assert not any(set(kinds(world)) & set(outsiders(world)) for world in WORLDS)


def test_of_one_family_nothing_or_one_effect_is_hidden_of_the_sizes_that_are_wished() -> None:
    spread = CaseDistribution(sizes=(1.0, 2.0), family="physics")
    known = subject_of(load("rope_push@rods")).catalogue()
    cases = [drawn(5, number, "mujoco", BLIND, spread) for number in range(COUNT)]
    assert np.mean([not case.hidden for case in cases]) == pytest.approx(NONE, abs=0.03)
    assert {len(case.hidden) for case in cases} == {0, 1}
    hidden = [each for case in cases for each in case.hidden]
    assert {known.cause(each.effect).family for each in hidden} == {"physics"}
    assert all(1.0 <= each.size <= 2.0 for each in hidden)


def test_in_beans_is_hidden_what_beans_can_have() -> None:
    assert BEANS.worlds == ("mujoco",)
    inside, outside = kinds("mujoco", BEANS), outsiders("mujoco", BEANS)
    assert {"rolling_resistance", "table_tilt", "command_delay", "tcp_offset"} <= set(inside)
    assert not {"mass_heterogeneity", "mask_erosion", "depth_scale"} & {*inside, *outside}
    assert "swirl" in outside


def test_in_a_cloth_is_hidden_what_a_cloth_can_have() -> None:
    assert CLOTH.worlds == ("mujoco",)
    inside, outside = kinds("mujoco", CLOTH), outsiders("mujoco", CLOTH)
    assert {"tcp_offset", "under_reach", "depth_scale"} <= set(inside)
    assert not {"rolling_resistance", "liquid_viscosity"} & {*inside, *outside}


@pytest.mark.parametrize("task", sorted(BODIES))
def test_every_task_of_the_bench_hides_something_that_it_may_name(task) -> None:
    making = Making(dynamics="rods" if task == "rope_push" else "mpm", task=task)
    for world in making.worlds:
        cases = [drawn(5, number, world, making) for number in range(20)]
        hidden = [each for case in cases for each in case.hidden]
        assert {each.effect for each in hidden} & set(kinds(world, making))
        assert all(real_size(each, making.body) > 0 for each in hidden if each.effect in kinds(world, making))
