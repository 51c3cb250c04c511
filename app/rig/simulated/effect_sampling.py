"""Effect sampling: the catalogue of injectable effects, and their values for a request and a seed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from app.core.errors import ParameterError, UsageError
from app.core.geometry.scene_description import Beans, Body, Cloth, Liquid, Rope, RopeModel, Soup
from app.rig.simulated import injected_effects
from app.rig.simulated.injected_effects.base import Hidden, InjectedEffect, InjectedParameter
from app.rig.simulated.worlds.physics import (
    BEAN_WORLD,
    CLOTH_WORLD,
    LIQUID_WORLD,
    ROPE_WORLDS,
    WorldPhysics,
    with_size,
)
from app.sim import effects
from app.sim.files import files_of
from app.sim.model.numerics import NUMERICS, OURS, POUR_NUMERICS, ROD_NUMERICS

MISTUNED = 0.3
"""Largest deviation of the friction of table and tool and of the stiffness of rope and cloth or the beans' rolling, as
a share of the nominal world's."""
_DRAWS, _TUNING = 1, 2
"""Random streams of a seed, so that none depends on the draws of another."""


class InjectionRequest(NamedTuple):
    """Request for an effect, with its size in the unit of its main parameter; None for the typical one."""

    name: str
    size: float | None


def injectable_effects() -> dict[str, Hidden]:
    """Every injectable effect by name: each file of the folder `injected_effects`."""
    return {name: module.HIDDEN for name, module in files_of(injected_effects)}


def not_injectable() -> dict[str, str]:
    """Reasons why causes of discovery's catalogue cannot be injected here, by name."""
    said = {name: module.EFFECT.not_injectable for name, module in files_of(effects)}
    own = dict.fromkeys((*NUMERICS, *POUR_NUMERICS), OURS) | {
        name: unknown.not_injectable for name, unknown in ROD_NUMERICS.items()
    }
    return {name: reason for name, reason in (said | own).items() if reason}


def draw(requests: Sequence[InjectionRequest], seed: int, body: type[Body] = Rope) -> tuple[InjectedEffect, ...]:
    """The effects with random directions, positions and signs of `seed`, in alphabetical order.

    `body`: class of the object that they are hidden in. Raises UsageError for an effect that is unknown, impossible, of
    no such object or requested twice, ParameterError for a size out of range.
    """
    rng = np.random.default_rng([seed, _DRAWS])
    return tuple(
        InjectedEffect(name=name, effect=effect, values=effect.draw(size, rng))
        for name, effect, size in _requested_effects(requests, body)
    )


def check_world(hidden: Sequence[InjectedEffect], world: RopeModel) -> None:
    """Raises UsageError where the rope's world does not support an effect: a cable supports none of its own."""
    names = [each.name for each in hidden if each.effect.in_world]
    if world != "chain" and names:
        raise UsageError(
            f"--world {world} hides nothing in rope, table and finger so far: leave out {', '.join(names)}, or --world."
        )


def mistune(seed: int, world: RopeModel = "chain", body: Body | None = None) -> WorldPhysics:
    """The world's physics with perturbed friction and stiffness, as no two tables and ropes are the same.

    `body`: a rope of other sizes than the cell's, beans, whose resistance to rolling is perturbed, a cloth, or a
    liquid, with pieces or without, of which that is its bulk modulus.
    """
    table, tool, stiffness = np.random.default_rng([seed, _TUNING]).uniform(1 - MISTUNED, 1 + MISTUNED, 3).tolist()
    if isinstance(body, Beans):
        nominal, rolling_m = BEAN_WORLD, BEAN_WORLD.rolling.rolling_m * stiffness
        rubbing = replace(nominal, rolling=replace(nominal.rolling, rolling_m=rolling_m))
    elif isinstance(body, Cloth):
        nominal = CLOTH_WORLD
        rubbing = replace(nominal, cloth=replace(nominal.cloth, membrane_n_m=nominal.cloth.membrane_n_m * stiffness))
    elif isinstance(body, Liquid | Soup):
        nominal, rubbing = LIQUID_WORLD, replace(LIQUID_WORLD, bulk_pa=LIQUID_WORLD.bulk_pa * stiffness)
    else:
        nominal = ROPE_WORLDS[world] if body is None else with_size(ROPE_WORLDS[world], body)
        rubbing = _with_stiffness(nominal, stiffness)
    return replace(
        rubbing,
        table_friction=nominal.table_friction * table,
        finger_friction=nominal.finger_friction * tool,
    )


def _with_stiffness(nominal: WorldPhysics, stiffness: float) -> WorldPhysics:
    """The rope's stiffness as a multiple of the nominal one."""
    chain, cable = nominal.rope, nominal.cable
    return replace(
        nominal,
        rope=replace(chain, bend_stiffness_n_m_rad=chain.bend_stiffness_n_m_rad * stiffness),
        cable=None if cable is None else replace(cable, rigidity_n_m2=cable.rigidity_n_m2 * stiffness),
    )


def describe(hidden: Sequence[InjectedEffect]) -> list[dict[str, Any]]:
    """The effects with their values, as stored in a sealed file."""
    return [
        {
            "effect": each.name,
            "family": each.effect.family,
            "catalogued": each.effect.catalogued,
            "parameters": {
                quantity.name: {"value": value, "unit": quantity.unit, "null": quantity.null}
                for quantity, value in zip(each.effect.quantities, each.values.tolist(), strict=True)
            },
        }
        for each in hidden
    ]


def _requested_effects(requests: Sequence[InjectionRequest], body: type[Body]) -> Iterator[tuple[str, Hidden, float]]:
    files, impossible = injectable_effects(), not_injectable()
    here = ", ".join(name for name, effect in files.items() if body in effect.bodies)
    names = [request.name for request in requests]
    for request in sorted(requests, key=lambda request: request.name):
        if reason := impossible.get(request.name):
            raise UsageError(f"{request.name} cannot be hidden: {reason}. What can be: {here}.")
        if request.name not in files:
            raise UsageError.unknown("effect", request.name, files)
        if body not in files[request.name].bodies:
            raise UsageError(f"{request.name} is nothing that {body.__name__} can have. What can be hidden: {here}.")
        if names.count(request.name) > 1:
            raise UsageError(f"{request.name} is named twice; name each effect once, as EFFECT or EFFECT=SIZE.")
        yield request.name, files[request.name], _size(request, files[request.name].main_in(body))


def _size(request: InjectionRequest, main: InjectedParameter) -> float:
    if request.size is None:
        return float(main.typical or 0.0)
    if not main.low <= request.size <= main.high:
        raise ParameterError(
            f"{request.name}={request.size:g} is outside {main.low:g} to {main.high:g} {main.unit} "
            f"({main.name}; {main.typical:g} is typical). Signs and directions are drawn from the seed."
        )
    return request.size
