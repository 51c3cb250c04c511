"""Composition of the primitives of a scene's tools: their joint action on one particle."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportReturnType=false, reportUntypedFunctionDecorator=false

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.constants import Constants, Shape
from app.sim.contact import FAR, LEAST_TOUCH, sigmoid, touch_aim, touch_share
from app.sim.effect_composition import Hooks
from app.sim.effects.base import ParticleContext, WarpFunction
from app.sim.tools.base import COORDINATES, Motion, Primitive, Tool

PATIENCE = 20.0
"""Slow-down factor of the push out of the margin of thin primitives, which their barrier guards anyway.

Water that is filled into a bowl with some particles nearer to the wall than the margin was thrown up by 7 % of its
depth at 1, and by 1 % at 20.
"""

CLOSING = wp.constant(0.002)
"""Range of opening [m] over which a grasp closes and releases: little for a gripper that opens by 40 mm."""


@final
@dataclass(frozen=True, kw_only=True)
class Part:
    """A primitive as code: its surface, its motion, the first of its coordinates in the path, and its kind."""

    surface: WarpFunction
    motion: Motion
    at: int
    side: int
    thin: bool
    grasps: bool


def parts(tools: Sequence[Tool]) -> tuple[tuple[Part, ...], tuple[Primitive, ...], int]:
    """The primitives of all tools as code and as numbers, and the number of coordinates of a path."""
    code: list[Part] = []
    numbers: list[Primitive] = []
    at = 0
    for tool in tools:
        for primitive in tool.primitives():
            numbers.append(primitive)
            code.append(
                Part(
                    surface=primitive.surface,
                    motion=tool.motion,
                    at=at,
                    side=primitive.side,
                    thin=primitive.thin,
                    grasps=primitive.grasps,
                )
            )
        at += COORDINATES[tool.motion]
    return tuple(code), tuple(numbers), at


def touching(parts: Sequence[Part], hooks: Hooks) -> WarpFunction:
    """`touch(k, x, m, now, then, grain, phi) -> touch, aim`: sums over the tools that a particle of mass m touches.

    `now` and `then` are the coordinates of all tools at the beginning and the end of the substep. touch is
    (normal, 1) and aim (velocity [m/s], friction), both times the touching mass [kg].
    """
    function: WarpFunction = _touches_nothing
    for i, part in enumerate(parts):
        function = _touching_too(function, part, i, hooks["tool_friction"])
    return function


def barrier(parts: Sequence[Part]) -> WarpFunction | None:
    """`hold(k, x, v, now, then) -> x, v`: a particle is taken along by what grasps it, then moved out of what is thin.

    None where nothing grasps and nothing is thin.
    """
    function: WarpFunction | None = None
    for i, part in enumerate(parts):
        if part.grasps:
            function = _grasping_too(function or _holds_nothing, part, i)
    for i, part in enumerate(parts):
        if part.thin:
            function = _holding_too(function or _holds_nothing, part, i)
    return function


@wp.func
def _touches_nothing(_k: Constants, _x: wp.vec3, _m: float, _now: Any, _then: Any, _grain: ParticleContext, _phi: Any):
    return wp.vec4(), wp.vec4()


@wp.func
def _holds_nothing(_k: Constants, x: wp.vec3, v: wp.vec3, _now: Any, _then: Any):
    return x, v


def _touching_too(before: WarpFunction, part: Part, i: int, tool_friction: WarpFunction) -> WarpFunction:
    surface, (into, turned, drift), closed = part.surface, _motion(part), _closed(part)
    patience = wp.constant(PATIENCE if part.thin else 1.0)

    @wp.func
    def touch_all(k: Constants, x: wp.vec3, m: float, now: Any, then: Any, grain: ParticleContext, phi: Any):
        touch, aim = before(k, x, m, now, then, grain, phi)
        p = into(k.shapes[i], x, now)
        n, distance, cover = surface(k.shapes[i], p)
        gap = distance - k.contact_margin
        if gap < FAR * k.contact_width:
            share = cover * touch_share(k, gap) * closed(k.shapes[i], now)
            if share > LEAST_TOUCH:
                normal = turned(k.shapes[i], n, now)
                target = touch_aim(k, gap / patience, normal, drift(k.shapes[i], p, now, then) / k.dt)
                friction = tool_friction(k.shapes[i].friction, grain, phi)
                touch += (m * share) * wp.vec4(normal[0], normal[1], normal[2], 1.0)
                aim += (m * share) * wp.vec4(target[0], target[1], target[2], friction)
        return touch, aim

    return touch_all


def _closed(part: Part) -> WarpFunction:
    """`closed(s, c)`: the share of what there is to touch that is touched, at the opening in the coordinates c."""
    at = part.at

    @wp.func
    def always(_s: Shape, _c: Any) -> float:
        return 1.0

    @wp.func
    def when_closed(s: Shape, c: Any) -> float:
        return sigmoid((s.size[3] - c[at + 7]) / CLOSING)

    return when_closed if part.grasps else always


def _holding_too(before: WarpFunction, part: Part, i: int) -> WarpFunction:
    surface, (into, turned, drift) = part.surface, _motion(part)

    @wp.func
    def hold_all(k: Constants, x: wp.vec3, v: wp.vec3, now: Any, then: Any):
        x_held, v_held = before(k, x, v, now, then)
        p = into(k.shapes[i], x_held, then)
        n, gap, _cover = surface(k.shapes[i], p)
        if gap < 0.0:
            normal = turned(k.shapes[i], n, then)
            x_held = x_held - gap * normal
            wall = drift(k.shapes[i], p, now, then) / k.dt
            v_held = v_held + wp.max(0.0, wp.dot(wall - v_held, normal)) * normal
        return x_held, v_held

    return hold_all


def _grasping_too(before: WarpFunction, part: Part, i: int) -> WarpFunction:
    """Grasp particle by particle: only part of a node's matter is within reach, and held matter must not slip."""
    surface, (into, _turned, drift), closed = part.surface, _motion(part), _closed(part)

    @wp.func
    def grasp_all(k: Constants, x: wp.vec3, v: wp.vec3, now: Any, then: Any):
        x_held, v_held = before(k, x, v, now, then)
        p = into(k.shapes[i], x_held, then)
        _n, _gap, cover = surface(k.shapes[i], p)
        share = cover * closed(k.shapes[i], then)
        if share > LEAST_TOUCH:
            missing = share * (drift(k.shapes[i], p, now, then) / k.dt - v_held)
            x_held = x_held + k.dt * missing
            v_held = v_held + missing
        return x_held, v_held

    return grasp_all


def _motion(part: Part) -> tuple[WarpFunction, WarpFunction, WarpFunction]:
    """Kinematics of a part: `into`, `turned` and `drift`.

    `into(s, x, c) -> p`, a point of the world in the primitive's frame; `turned(s, n, c) -> n`, a direction of its
    frame in the world; `drift(s, p, now, then)`, how far a point of the tool at p moves [m].
    """
    return {"fixed": _fixed, "slides": _sliding, "turns": _turning, "opens": _opening}[part.motion](part)


def _fixed(part: Part) -> tuple[WarpFunction, WarpFunction, WarpFunction]:
    del part

    @wp.func
    def into(s: Shape, x: wp.vec3, _c: Any) -> wp.vec3:
        return wp.quat_rotate_inv(s.turn, x - s.place)

    @wp.func
    def turned(s: Shape, n: wp.vec3, _c: Any) -> wp.vec3:
        return wp.quat_rotate(s.turn, n)

    @wp.func
    def drift(_s: Shape, _p: wp.vec3, _now: Any, _then: Any) -> wp.vec3:
        return wp.vec3()

    return into, turned, drift


def _sliding(part: Part) -> tuple[WarpFunction, WarpFunction, WarpFunction]:
    at = part.at

    @wp.func
    def into(s: Shape, x: wp.vec3, c: Any) -> wp.vec3:
        return wp.quat_rotate_inv(s.turn, x - wp.vec3(c[at], c[at + 1], c[at + 2]) - s.place)

    @wp.func
    def turned(s: Shape, n: wp.vec3, _c: Any) -> wp.vec3:
        return wp.quat_rotate(s.turn, n)

    @wp.func
    def drift(_s: Shape, _p: wp.vec3, now: Any, then: Any) -> wp.vec3:
        return wp.vec3(then[at] - now[at], then[at + 1] - now[at + 1], then[at + 2] - now[at + 2])

    return into, turned, drift


def _turning(part: Part) -> tuple[WarpFunction, WarpFunction, WarpFunction]:
    at = part.at

    @wp.func
    def orientation(c: Any) -> wp.quat:
        return wp.quat(c[at + 4], c[at + 5], c[at + 6], c[at + 3])

    @wp.func
    def into(s: Shape, x: wp.vec3, c: Any) -> wp.vec3:
        own = wp.quat_rotate_inv(orientation(c), x - wp.vec3(c[at], c[at + 1], c[at + 2]))
        return wp.quat_rotate_inv(s.turn, own - s.place)

    @wp.func
    def turned(s: Shape, n: wp.vec3, c: Any) -> wp.vec3:
        return wp.quat_rotate(orientation(c), wp.quat_rotate(s.turn, n))

    @wp.func
    def drift(s: Shape, p: wp.vec3, now: Any, then: Any) -> wp.vec3:
        own = s.place + wp.quat_rotate(s.turn, p)
        slid = wp.vec3(then[at] - now[at], then[at + 1] - now[at + 1], then[at + 2] - now[at + 2])
        return slid + wp.quat_rotate(orientation(then), own) - wp.quat_rotate(orientation(now), own)

    return into, turned, drift


def _opening(part: Part) -> tuple[WarpFunction, WarpFunction, WarpFunction]:
    """Kinematics of turning, with half of the opening along the tool's y, to the primitive's side."""
    at, side = part.at, float(part.side)
    turning_into, turned, _ = _turning(part)

    @wp.func
    def into(s: Shape, x: wp.vec3, c: Any) -> wp.vec3:
        return turning_into(s, x, c) - wp.quat_rotate_inv(s.turn, wp.vec3(0.0, 0.5 * side * c[at + 7], 0.0))

    @wp.func
    def drift(s: Shape, p: wp.vec3, now: Any, then: Any) -> wp.vec3:
        own = s.place + wp.quat_rotate(s.turn, p)
        before = own + wp.vec3(0.0, 0.5 * side * now[at + 7], 0.0)
        after = own + wp.vec3(0.0, 0.5 * side * then[at + 7], 0.0)
        slid = wp.vec3(then[at] - now[at], then[at + 1] - now[at + 1], then[at + 2] - now[at + 2])
        turn = wp.quat(then[at + 4], then[at + 5], then[at + 6], then[at + 3])
        turn_before = wp.quat(now[at + 4], now[at + 5], now[at + 6], now[at + 3])
        return slid + wp.quat_rotate(turn, after) - wp.quat_rotate(turn_before, before)

    return into, turned, drift
