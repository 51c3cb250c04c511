"""Effects hidden in a cloth: they vanish at their null, act as they say, and those of other objects are refused."""

import dataclasses

import numpy as np
import pytest

from app.core.errors import UsageError
from app.core.geometry.scene_description import Cloth
from app.rig.simulated.effect_sampling import InjectionRequest, draw, injectable_effects, mistune
from app.rig.simulated.injected_effects.base import InjectedEffect, Moment, acting
from app.rig.simulated.worlds.cloth_world import ClothWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import CLOTH_WORLD
from tests.rig.cloth_scene import CLOTH, GRIPPER, go, hand
from tests.rig.hidden.moments import injected

SMALL = dataclasses.replace(CLOTH, size_m=0.12, mass_kg=0.003, nodes_a_side=7)
OF_CLOTH = [name for name, effect in injectable_effects().items() if Cloth in effect.bodies]
OF_OTHERS = [name for name in injectable_effects() if name not in OF_CLOTH]
IN_WORLD = [name for name in OF_CLOTH if injectable_effects()[name].in_world]


def flat() -> np.ndarray:
    axis = np.linspace(-SMALL.size_m / 2, SMALL.size_m / 2, SMALL.nodes_a_side)
    u, v = (each.ravel() for each in np.meshgrid(axis, axis, indexing="ij"))
    return np.stack([0.55 + u, -0.02 + v, np.full_like(u, 0.002)], axis=1)


def world(*hidden: InjectedEffect) -> ClothWorld:
    return ClothWorld(SMALL, GRIPPER, flat(), turns=True, intrusion=Intrusion(hidden))


def carried(cell: ClothWorld) -> np.ndarray:
    """The cloth, taken at its edge, lifted a little, dragged and turned."""
    cell.intrusion.session = -0.5
    cell.place(hand(0.55, 0.03, 0.006, 0.04))
    turned = hand(0.50, 0.0, 0.06, 0.004)
    turned[3:7] = [0.0, np.cos(0.2), np.sin(0.2), 0.0]
    return go(cell, hand(0.55, 0.03, 0.006, 0.004), hand(0.55, 0.02, 0.05, 0.004), turned, rest_s=0.1)


@pytest.fixture(scope="module")
def plain() -> np.ndarray:
    return carried(world())


@pytest.mark.parametrize("name", IN_WORLD)
def test_at_its_null_an_effect_leaves_the_cloth_as_it_is_to_the_last_bit(name: str, plain: np.ndarray) -> None:
    effect = injectable_effects()[name]
    nothing = InjectedEffect(name=name, effect=effect, values=np.array([each.null for each in effect.quantities]))
    assert np.array_equal(carried(world(nothing)), plain)


@pytest.mark.parametrize("name", IN_WORLD)
def test_at_its_typical_size_an_effect_moves_the_cloth_otherwise_and_leaves_it_in_the_hand(
    name: str, plain: np.ndarray
) -> None:
    (here,) = draw([InjectionRequest(name, None)], 0, Cloth)
    instead = {"_x": 0.53, "_y": -0.03, "step_time": -0.1}
    values = [
        next((at for end, at in instead.items() if quantity.name.endswith(end) and quantity.typical is None), value)
        for quantity, value in zip(here.effect.quantities, here.values, strict=True)
    ]
    moved = carried(world(dataclasses.replace(here, values=np.array(values))))
    assert 1e-6 < np.abs(moved - plain).max() < 0.1


@pytest.mark.parametrize("name", OF_OTHERS)
def test_an_effect_of_other_objects_is_refused_with_what_a_cloth_can_have(name: str) -> None:
    with pytest.raises(UsageError, match=f"{name} is nothing that Cloth can have.*draught"):
        draw([InjectionRequest(name, None)], 0, Cloth)


def test_a_held_cloth_turns_with_the_gripper() -> None:
    cell = world()
    nodes = carried(cell)
    held = cell.held_nodes
    assert held.sum() >= 2
    assert 2 * np.arctan2(cell.tool[5], cell.tool[4]) == pytest.approx(0.4)
    away = nodes[held] - cell.tool[:3]
    # The two rows of knots that are held stay along the fingers, as far from the middle as each other.
    assert np.ptp(np.abs(away @ [-np.sin(0.4), np.cos(0.4), 0.0])) < 1e-3
    assert np.ptp(away @ [np.cos(0.4), np.sin(0.4), 0.0]) > 0.03


def test_the_knots_weigh_as_much_as_the_cloth_and_a_force_pulls_at_each() -> None:
    seen = list[Moment]()

    def force(moment: Moment, values: np.ndarray) -> np.ndarray:
        seen.append(moment)
        return acting(moment, np.tile([values[0], 0.0, 0.0], (len(moment.x), 1)))

    wind = injected("draught", 8.0, 0.0)
    steady = dataclasses.replace(wind, effect=dataclasses.replace(wind.effect, force=force))
    cell = world(steady)
    blown = carried(cell)
    assert seen[-1].mass.sum() == pytest.approx(SMALL.mass_kg)
    assert np.abs(seen[-1].x - blown).max() < 1e-3
    assert seen[-1].tool == pytest.approx(cell.tool[:3], abs=1e-6)
    assert blown[:, 0].mean() > carried(world())[:, 0].mean() + 0.005


def test_a_table_and_a_cloth_are_never_quite_the_usual_ones() -> None:
    one, other = (mistune(seed, body=CLOTH) for seed in (1, 2))
    for physics in (one, other):
        assert 0.7 <= physics.cloth.membrane_n_m / CLOTH_WORLD.cloth.membrane_n_m <= 1.3
        assert 0.7 <= physics.table_friction / CLOTH_WORLD.table_friction <= 1.3
    assert one.cloth.membrane_n_m != other.cloth.membrane_n_m
