"""Requests of hidden effects: the ones that can be made, and the values that are drawn for them."""

import numpy as np
import pytest

from app.core.errors import ParameterError, UsageError
from app.core.geometry.scene_description import Rope
from app.rig.simulated.effect_sampling import (
    MISTUNED,
    InjectionRequest,
    draw,
    injectable_effects,
    mistune,
    not_injectable,
)
from app.rig.simulated.worlds.physics import ROPE_WORLDS, WorldPhysics, with_size


@pytest.mark.parametrize("name", not_injectable())
def test_what_this_world_cannot_hide_is_said_with_the_reason_and_what_it_can(name: str) -> None:
    with pytest.raises(UsageError, match=f"{name} cannot be hidden: .*table_tilt"):
        draw([InjectionRequest(name, None)], 0)


def test_an_unknown_effect_names_the_nearest() -> None:
    with pytest.raises(UsageError, match="Did you mean 'table_tilt'"):
        draw([InjectionRequest("table_tlit", None)], 0)


@pytest.mark.parametrize("size", [-1.0, 5.1, np.nan, np.inf])
def test_a_size_out_of_range_names_range_unit_and_what_is_typical(size: float) -> None:
    with pytest.raises(ParameterError, match=r"outside 0 to 5 deg \(tilt_x; 1 is typical\)"):
        draw([InjectionRequest("table_tilt", size)], 0)


def test_an_effect_is_hidden_once() -> None:
    with pytest.raises(UsageError, match="named twice"):
        draw([InjectionRequest("table_tilt", None), InjectionRequest("table_tilt", 2.0)], 0)


def test_effects_act_in_one_order_however_they_are_named() -> None:
    wishes = [
        InjectionRequest("table_tilt", None),
        InjectionRequest("backlash", None),
        InjectionRequest("draught", 0.2),
    ]
    first, again = ([each.name for each in draw(order, 3)] for order in (wishes, wishes[::-1]))
    assert first == again == sorted(first)


def test_signs_and_directions_are_drawn_both_ways() -> None:
    drifts = {float(np.sign(draw([InjectionRequest("friction_drift", 0.4)], seed)[0].values[0])) for seed in range(20)}
    tilts = np.array([draw([InjectionRequest("table_tilt", 1.0)], seed)[0].values for seed in range(40)])
    assert drifts == {-1.0, 1.0}
    assert np.abs(tilts.mean(0)).max() < 0.4
    assert len(injectable_effects()) > 30


def test_every_world_is_tuned_otherwise_by_up_to_thirty_per_cent() -> None:
    nominal, worlds = WorldPhysics(), [mistune(seed) for seed in range(60)]
    for off in (
        np.array([world.table_friction / nominal.table_friction for world in worlds]),
        np.array([world.finger_friction / nominal.finger_friction for world in worlds]),
        np.array([w.rope.bend_stiffness_n_m_rad / nominal.rope.bend_stiffness_n_m_rad for w in worlds]),
    ):
        assert np.abs(off - 1).max() <= MISTUNED
        assert np.ptp(off) > MISTUNED
    assert mistune(5) == mistune(5)


def test_a_cable_is_as_much_off_as_a_chain_of_the_same_seed() -> None:
    chain, cable = mistune(5), mistune(5, "cable")
    assert cable.cable is not None
    nominal = ROPE_WORLDS["cable"].cable
    assert nominal is not None
    stiffer = chain.rope.bend_stiffness_n_m_rad / WorldPhysics().rope.bend_stiffness_n_m_rad
    assert cable.cable.rigidity_n_m2 / nominal.rigidity_n_m2 == pytest.approx(stiffer)
    assert (cable.table_friction, cable.finger_friction) == (chain.table_friction, chain.finger_friction)


def test_a_rope_of_another_size_is_of_the_same_material() -> None:
    """The flexural rigidity E I goes with the fourth power of the radius; the rope yields at the same curvature."""
    cell = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.064, colour=(0.8, 0.2, 0.1))
    thin = Rope(length_m=0.60, radius_m=0.004, mass_kg=0.03, colour=(0.8, 0.2, 0.1))
    for nominal in ROPE_WORLDS.values():
        assert with_size(nominal, cell) == nominal
        made, segments = with_size(nominal, thin), nominal.rope.segments
        rigidity, usual = (
            physics.rope.bend_stiffness_n_m_rad * rope.length_m / segments
            for physics, rope in ((made, thin), (nominal, cell))
        )
        assert rigidity == pytest.approx(usual / 16)
        curvature, before = made.rope.bend_yield_rad / 0.60, nominal.rope.bend_yield_rad / 0.40
        assert curvature == pytest.approx(before)
        if nominal.cable is not None and made.cable is not None:
            assert made.cable.rigidity_n_m2 == pytest.approx(nominal.cable.rigidity_n_m2 / 16)
    assert mistune(5, body=cell) == mistune(5)
