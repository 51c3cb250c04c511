"""The laws of effects on rods as text for the compiler, and the numbers that they need."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import jax
import jax.numpy as jnp
from jaxtyping import Float

from app.core.errors import ParameterError
from app.sim.effects.base import Effect
from app.sim.rods.effect import RodContext, RodEffect, RodProperties
from app.sim.rods.scene import Wall

_LAW = """
struct {name} {{
    static constexpr int NUMBERS = {numbers};
    static constexpr bool HAS_VELOCITY = {has_velocity}, HAS_FRICTION = {has_friction}, HAS_BEND = {has_bend};
    template <typename T>
    ROD_CALL void velocity(const Numbers& k, const T* phi, const T& x, const T& y, T& vx, T& vy) {{
        {velocity}
    }}
    template <typename T>
    ROD_CALL void friction(const Numbers& k, const T* phi, const T& x, const T& y, const T& vx, const T& vy, T& mu) {{
        {friction}
    }}
    template <typename T>
    ROD_CALL void bend(const Numbers& k, const T* phi, T& e) {{
        {bend}
    }}
}};
"""


def require_known(effects: Sequence[Effect]) -> None:
    """Raises ParameterError, which names the parameters, for effects that do not act on rods."""
    if unknown := [spec.name for effect in effects if effect.rod is None for spec in effect.parameters]:
        names = ", ".join(unknown)
        raise ParameterError(f"Rods do not know {names}; simulate material points: a task without @rods.")


def law_source(effects: Sequence[Effect], walls: int = 0, *, flat: bool = False) -> str:
    """C++ structs of these effects' laws, and the list of all laws, so many walls last; "" where there is none.

    `flat`: the finger is one.
    """
    laws = [_law(f"Law{number}", effect, rod) for number, (effect, rod) in enumerate(_lawful(effects))]
    names = [f"Law{number}" for number in range(len(laws))] + ["BoxWall"] * walls
    uneven = any(rod.lightens for _, rod in _rod_effects(effects))
    if not (names or uneven or flat):
        return ""
    flags = f"#define ROD_UNEVEN {_flag(uneven)}\n#define ROD_FLAT {_flag(flat)}\n"
    defined = f"#define ROD_LAWS {', '.join(names)}\n{flags}"
    return f'#include "walls.h"\nnamespace rods {{\n{"".join(laws)}}}  // namespace rods\n{defined}'


def law_numbers(
    effects: Sequence[Effect], phi: Float[jax.Array, "B P"], context: RodContext
) -> list[Float[jax.Array, "B _"]]:
    """The numbers of these effects' laws, in the order of their list. Raises ValueError for a wrong count."""
    parts, found = _parts(effects, phi), list[jax.Array]()
    for (effect, rod), own in zip(_rod_effects(effects), parts, strict=True):
        if not rod.has_law:
            continue
        numbers = rod.numbers(own, context)
        if numbers.shape != own.shape:
            raise ValueError(
                f"The numbers of the law of {effect.parameters[0].name} have the shape {numbers.shape}, and its "
                f"parameters {own.shape}: give as many numbers as parameters, unused ones as zeros."
            )
        found.append(numbers)
    return found


def wall_numbers(walls: Sequence[Wall], rougher: Float[jax.Array, " B"]) -> list[Float[jax.Array, "B 5"]]:
    """The numbers of walls, whose friction is scaled as much as the finger's."""

    def numbers(wall: Wall) -> jax.Array:
        corners = jnp.broadcast_to(jnp.array([*wall.low_m, *wall.high_m]), (len(rougher), 4))
        return jnp.concatenate([corners, wall.friction * rougher[:, None]], axis=1)

    return [numbers(wall) for wall in walls]


def changed_properties(
    effects: Sequence[Effect], properties: RodProperties, phi: Float[jax.Array, "B P"], context: RodContext
) -> RodProperties:
    """Properties as changed by these effects, one after the other."""
    for (_, rod), own in zip(_rod_effects(effects), _parts(effects, phi), strict=True):
        if rod.properties is not None:
            properties = rod.properties(properties, context, own)
    return properties


def _rod_effects(effects: Sequence[Effect]) -> Iterator[tuple[Effect, RodEffect]]:
    return ((effect, effect.rod) for effect in effects if effect.rod is not None)


def _lawful(effects: Sequence[Effect]) -> Iterator[tuple[Effect, RodEffect]]:
    return ((effect, rod) for effect, rod in _rod_effects(effects) if rod.has_law)


def _parts(effects: Sequence[Effect], phi: Float[jax.Array, "B P"]) -> list[jax.Array]:
    """The parameters of each effect."""
    ends = [0]
    for effect in effects:
        ends.append(ends[-1] + len(effect.parameters))
    return [phi[:, first:last] for first, last in pairwise(ends)]


def _flag(value: str | bool) -> str:
    return "true" if value else "false"


def _law(name: str, effect: Effect, rod: RodEffect) -> str:
    return _LAW.format(
        name=name,
        numbers=len(effect.parameters),
        has_velocity=_flag(rod.velocity),
        has_friction=_flag(rod.friction),
        has_bend=_flag(rod.bend),
        velocity=rod.velocity.strip(),
        friction=rod.friction.strip(),
        bend=rod.bend.strip(),
    )
