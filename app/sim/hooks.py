"""Puts the effects' hooks one after the other, once for a simulation and once for its adjoint."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.effects.base import Effect, Grain, Node, WarpFunction
from app.sim.parameter import ParameterSpec

NODE_HOOKS = ("node_velocity", "table_friction", "adhesion")
GRAIN_HOOKS = ("stiffness", "mass", "rest", "viscosity", "kept", "cohesion", "tool_friction")


@final
@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns of phi nodes need, and which particles: a kernel carries no more than it uses."""

    node: tuple[int, ...]
    grain: tuple[int, ...]


def columns(nominal: Sequence[ParameterSpec], effects: Sequence[Effect]) -> Columns:
    """Of phi with `nominal` and then the effects' parameters: the first for particles, the second for nodes."""
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

    `acting(name)` is one that says whether any of a name's effects is not at its null. A hook without effects is None.
    """

    composed: dict[str, WarpFunction]
    acting: dict[str, WarpFunction]

    def __getitem__(self, name: str) -> WarpFunction:
        return self.composed.get(name, _unchanged)

    def has(self, name: str) -> bool:
        """Whether any effect changes it."""
        return name in self.composed


def compose(effects: Sequence[Effect], *, lazy: bool) -> Hooks:
    """All hooks. `lazy` ones skip what is at its null: the same values in less time, but not the same derivatives."""
    composed: dict[str, WarpFunction] = {}
    acting: dict[str, WarpFunction] = {}
    for names in (NODE_HOOKS, GRAIN_HOOKS):
        at = 1  # The nominal parameter that comes first; see `columns`.
        for effect in effects:
            if not _has(effect, names):
                continue
            skip = _acts(effect, at) if lazy else None
            for name in names:
                hook = getattr(effect, name)
                if hook is not None:
                    composed[name] = _then(composed.get(name, _unchanged), hook, at, skip)
                    acting[name] = _either(acting.get(name, _never), skip or _always)
            at += len(effect.parameters)
    return Hooks(composed=composed, acting=acting)


def _has(effect: Effect, names: Sequence[str]) -> bool:
    return any(getattr(effect, name) is not None for name in names)


def _acts(effect: Effect, at: int) -> WarpFunction:
    """Whether the effect's switches are not all at their nulls."""
    function: WarpFunction = _never
    for offset, spec in enumerate(effect.parameters[: effect.switches]):
        function = _either(function, _differs(at + offset, spec.nominal))
    return function


def _differs(column: int, null: float) -> WarpFunction:
    @wp.func
    def differs(phi: Any) -> bool:
        return phi[column] != null

    return differs


def _either(one: WarpFunction, other: WarpFunction) -> WarpFunction:
    @wp.func
    def either(phi: Any) -> bool:
        return one(phi) or other(phi)

    return either


def _then(before: WarpFunction, hook: WarpFunction, at: int, acts: WarpFunction | None) -> WarpFunction:
    """`before`, then the hook with its parameters at `phi[at]`, if it acts at all."""
    if acts is None:

        @wp.func
        def then(value: Any, place: Any, phi: Any):
            return hook(before(value, place, phi), place, phi, at)

        return then

    @wp.func
    def then_if(value: Any, place: Any, phi: Any):
        result = before(value, place, phi)
        if acts(phi):
            result = hook(result, place, phi, at)
        return result

    return then_if


@wp.func
def _unchanged(value: Any, _place: Any, _phi: Any):
    return value


@wp.func
def _never(_phi: Any) -> bool:
    return False


@wp.func
def _always(_phi: Any) -> bool:
    return True


__all__ = ["GRAIN_HOOKS", "NODE_HOOKS", "Columns", "Grain", "Hooks", "Node", "columns", "compose"]
