"""Puts the effects' hooks one after the other.

An effect at its null is skipped, unless `every` of them is asked for: the value is the same, and so is its derivative
with respect to all but the effects' own parameters. So planning does not pay for what is not there.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.core.errors import ParameterError
from app.sim.effects.base import Effect, WarpFunction
from app.sim.parameter import ParameterSpec

NODE_HOOKS = ("node_velocity", "table_friction", "adhesion")
GRAIN_HOOKS = ("stiffness", "mass", "rest", "viscosity", "kept", "cohesion", "tool_friction")


def require_known(effects: Sequence[Effect]) -> None:
    """Raises ParameterError, which names the parameters, for effects that do not act on material points."""
    if unknown := [
        spec.name for each in effects if not _has(each, NODE_HOOKS + GRAIN_HOOKS) for spec in each.parameters
    ]:
        names = ", ".join(unknown)
        raise ParameterError(f"Material points do not know {names}; simulate rods: a task with @rods.")


@final
@dataclass(frozen=True, kw_only=True)
class Columns:
    """Columns of phi that nodes and particles need: a kernel carries no more than it uses."""

    node: tuple[int, ...]
    grain: tuple[int, ...]


def columns(nominal: Sequence[ParameterSpec], effects: Sequence[Effect]) -> Columns:
    """Columns of phi with `nominal` and then the effects' parameters, for each kind of kernel."""
    node, grain, at = [1], [0], len(nominal)
    for effect in effects:
        own = range(at, at + len(effect.parameters))
        node += own if _has(effect, NODE_HOOKS) else ()
        grain += own if _has(effect, GRAIN_HOOKS) else ()
        at += len(effect.parameters)
    return Columns(node=tuple(node), grain=tuple(grain))


@final
@dataclass(frozen=True, kw_only=True)
class Hooks:
    """The effects' hooks composed, by name: each a Warp function (value, Node or Grain, phi) -> value.

    `acting`: by name, whether any of its effects is to be called.
    """

    composed: dict[str, WarpFunction]
    acting: dict[str, WarpFunction]

    def __getitem__(self, name: str) -> WarpFunction:
        return self.composed.get(name, _unchanged)

    def acts(self, name: str) -> WarpFunction:
        """(Node or Grain, phi) -> whether any of a name's effects is to be called."""
        return self.acting.get(name, _never)

    def has(self, name: str) -> bool:
        """True if any effect changes the quantity `name`."""
        return name in self.composed


def compose(effects: Sequence[Effect]) -> Hooks:
    """All hooks."""
    composed: dict[str, WarpFunction] = {}
    acting: dict[str, WarpFunction] = {}
    for names in (NODE_HOOKS, GRAIN_HOOKS):
        at = 1  # The nominal parameter that comes first; see `columns`.
        for effect in effects:
            if not _has(effect, names):
                continue
            acts = _acts(effect, at)
            for name in names:
                hook = getattr(effect, name)
                if hook is not None:
                    composed[name] = _then(composed.get(name, _unchanged), hook, at, acts)
                    acting[name] = _either(acting[name], acts) if name in acting else acts
            at += len(effect.parameters)
    return Hooks(composed=composed, acting=acting)


def _has(effect: Effect, names: Sequence[str]) -> bool:
    return any(getattr(effect, name) is not None for name in names)


def _acts(effect: Effect, at: int) -> WarpFunction:
    """Warp predicate: true if `every` effect is asked for, or a switch of this one is off its null."""
    function: WarpFunction = _all_asked_for
    for offset, spec in enumerate(effect.parameters[: effect.switches]):
        function = _either(function, _differs(at + offset, spec.nominal))
    return function


@wp.func
def _all_asked_for(place: Any, _phi: Any) -> bool:
    return place.every != 0


def _differs(column: int, null: float) -> WarpFunction:
    @wp.func
    def differs(_place: Any, phi: Any) -> bool:
        return phi[column] != null

    return differs


def _either(one: WarpFunction, other: WarpFunction) -> WarpFunction:
    @wp.func
    def either(place: Any, phi: Any) -> bool:
        return one(place, phi) or other(place, phi)

    return either


def _then(before: WarpFunction, hook: WarpFunction, at: int, acts: WarpFunction) -> WarpFunction:
    """`before`, then the hook with its parameters at `phi[at]`, if it acts at all."""

    @wp.func
    def then(value: Any, place: Any, phi: Any):
        result = before(value, place, phi)
        if acts(place, phi):
            result = hook(result, place, phi, at)
        return result

    return then


@wp.func
def _unchanged(value: Any, _place: Any, _phi: Any):
    return value


@wp.func
def _never(_place: Any, _phi: Any) -> bool:
    return False
