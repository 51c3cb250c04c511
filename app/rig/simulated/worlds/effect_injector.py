"""Effect injector: applies injected effects to a running MuJoCo world, whatever its bodies are."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, final

import numpy as np

from app.core.geometry.scene_description import Body
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.worlds.physics import WorldPhysics

if TYPE_CHECKING:
    from app.rig.simulated.bodies.base import Bodies


@final
class Intrusion:
    """Effects in one world; inactive until attached to its bodies.

    `session`: position of the present push between the first (-0.5) and the last (0.5); set by the caller.
    """

    def __init__(self, hidden: Sequence[InjectedEffect]) -> None:
        self.session = 0.0
        self._hidden = tuple(hidden)
        self._bodies: Bodies | None = None

    @property
    def hides(self) -> bool:
        """True where any effect is in the world itself, not in arm and cameras alone."""
        return any(each.effect.in_world for each in self._hidden)

    @property
    def acts(self) -> bool:
        """True where any effect acts in each time step: bodies have to be attached then."""
        return any(_acts(each) for each in self._hidden)

    @property
    def rubs(self) -> bool:
        """True where any effect changes the bodies' friction on the table."""
        return any(each.effect.friction is not None for each in self._hidden)

    def physics(self, physics: WorldPhysics, body: Body) -> WorldPhysics:
        """The world's physics with the changes of these effects. Raises ValueError where one is of no such body."""
        for each in self._hidden:
            if not isinstance(body, each.effect.bodies):
                raise ValueError(f"{each.name} cannot be hidden in a world of {type(body).__name__}.")
            if each.effect.physics is not None:
                physics = each.effect.physics(physics, body, each.values)
        return physics

    @property
    def more(self) -> float:
        """Share of a liquid's volume by which there is more of it than its task says."""
        return sum((each.effect.more(each.values) for each in self._hidden if each.effect.more is not None), 0.0)

    def terms(self) -> dict[str, float]:
        """Parameters of the effects in the world itself, by name: for a world that has terms of these names."""
        return {
            quantity.name: float(value)
            for each in self._hidden
            if each.effect.in_world
            for quantity, value in zip(each.effect.quantities, each.values, strict=True)
        }

    def build(self, spec: Any, physics: WorldPhysics) -> None:
        """Change the MuJoCo `spec` before it is compiled."""
        for each in self._hidden:
            if each.effect.build is not None:
                each.effect.build(spec, physics, each.values)

    def attach(self, bodies: "Bodies") -> None:
        """Act on these bodies from now on."""
        self._bodies = bodies

    def act(self) -> None:
        """Set friction, forces and stiffness for the coming time step."""
        if self._bodies is None:
            return
        for each in self._hidden:
            if each.effect.relaxed is not None:
                self._bodies.relax(each.effect.relaxed(self._bodies.period_s, each.values))
        if not self._bodies.sleeps:
            self._stir(self._bodies)

    def _stir(self, bodies: "Bodies") -> None:
        """Set them for bodies that are awake."""
        moment = bodies.moment(self.session)
        friction, stiffness, force = np.ones(len(moment.x)), np.ones(len(moment.x)), np.zeros_like(moment.x)
        for effect, values in ((each.effect, each.values) for each in self._hidden):
            if effect.friction is not None:
                friction = friction * effect.friction(moment, values)
            if effect.stiffness is not None:
                stiffness = stiffness * effect.stiffness(moment, values)
            if effect.force is not None:
                force = force + effect.force(moment, values)
        bodies.rub(friction)
        bodies.stiffen(stiffness)
        bodies.pull(moment, force)


def _acts(each: InjectedEffect) -> bool:
    """True for an effect that acts in each time step."""
    effect = each.effect
    return any(hook is not None for hook in (effect.friction, effect.force, effect.stiffness, effect.relaxed))
