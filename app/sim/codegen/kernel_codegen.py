"""Kernel code of a scene: the laws of its bodies, the primitives of its tools, the effects; as Warp functions."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false

from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any, final

import warp as wp

from app.sim.codegen.tool_composition import Part, touching
from app.sim.constants import Constants, Matter
from app.sim.contact import pinch, table_contact, tool_contact
from app.sim.effect_composition import Hooks
from app.sim.effects.base import Effect, NodeContext, ParticleContext, WarpFunction
from app.sim.materials.base import Law


@final
@dataclass(frozen=True, kw_only=True)
class Code:
    """Compile-time part of a scene; scenes that differ in numbers alone share kernels."""

    laws: tuple[Law, ...]
    parts: tuple[Part, ...]
    coordinates: int
    effects: tuple[Effect, ...]

    def name(self) -> str:
        """A word that no other code has."""
        laws = [law.name for law in self.laws]
        parts = [
            (part.surface.__name__, part.motion, part.at, part.side, part.thin, part.grasps) for part in self.parts
        ]
        specs = [(spec.name, spec.nominal) for effect in self.effects for spec in effect.parameters]
        fields = [vars(replace(effect, rod=None)) for effect in self.effects]  # What acts on rods is not compiled here.
        hooks = [[hook for hook, value in each.items() if value is not None] for each in fields]
        return sha256(repr((laws, parts, self.coordinates, specs, hooks)).encode()).hexdigest()[:10]

    def grips(self) -> bool:
        """True if anything can be held between two sides of a tool."""
        return any(part.side or part.grasps for part in self.parts)


def particle_function(code: Code, law: Law, hooks: Hooks) -> WarpFunction:
    """`particle(k, m, phi, grain, x, v, C, F, now, then)`: contribution of a particle of this law to the grid.

    Its momentum [kg m/s], the slope of that a cell, its mass, its touch and aim (see `touching`), and its new F. The
    slope holds the stress: A = (-4 dt / cell^2 volume tau + m C) cell (Hu et al. 2018, eq. 29 and Alg. 1).
    """
    deform, touch_all = law.make(hooks), touching(code.parts, hooks)
    stiffness, mass, viscosity = hooks["stiffness"], hooks["mass"], hooks["viscosity"]
    viscous = law.fluid or hooks.has("viscosity")
    fluid = 1.0 if law.fluid else 0.0

    @wp.func
    def particle(
        k: Constants,
        m: Matter,
        phi: Any,
        grain: ParticleContext,
        x: wp.vec3,
        v: wp.vec3,
        C: wp.mat33,
        F: wp.mat33,
        now: Any,
        then: Any,
    ):
        own = grain
        own.fluid = fluid
        own_mass = mass(m.mass, own, phi)
        tau, F_next = deform(m, stiffness(phi[0] * m.share, own, phi), C, F, grain, phi)
        if wp.static(viscous):
            rate = C + wp.transpose(C)
            place = own
            place.shear = 0.5 * wp.ddot(rate, rate)
            tau += viscosity(m.viscosity, place, phi) * rate
        affine = (-4.0 * k.dt * k.per_cell * m.volume) * tau + (k.cell * own_mass) * C
        touch, aim = touch_all(k, x, own_mass, now, then, grain, phi)
        return own_mass * v, affine, own_mass, touch, aim, F_next

    return particle


def particle_work(particle: WarpFunction) -> WarpFunction:
    """The outputs of `particle` times their cotangents: the gradient of this number is the adjoint."""

    @wp.func
    def work(
        k: Constants,
        m: Matter,
        phi: Any,
        grain: ParticleContext,
        x: wp.vec3,
        v: wp.vec3,
        C: wp.mat33,
        F: wp.mat33,
        now: Any,
        then: Any,
        momentum_bar: wp.vec3,
        affine_bar: wp.mat33,
        mass_bar: float,
        touch_bar: wp.vec4,
        aim_bar: wp.vec4,
        F_bar: wp.mat33,
    ) -> wp.float32:
        momentum, affine, mass, touch, aim, F_next = particle(k, m, phi, grain, x, v, C, F, now, then)
        moved = wp.dot(momentum_bar, momentum) + wp.ddot(affine_bar, affine) + mass_bar * mass
        return moved + wp.dot(touch_bar, touch) + wp.dot(aim_bar, aim) + wp.ddot(F_bar, F_next)

    return work


def node_function(code: Code, hooks: Hooks) -> WarpFunction:
    """`velocity(k, phi, node, place, touch, aim)`: from a node's momentum and mass to its velocity [m/s].

    Damping, gravity, effects, table and tools.
    """
    node_velocity, table_friction, adhesion = hooks["node_velocity"], hooks["table_friction"], hooks["adhesion"]
    grips = code.grips()

    @wp.func
    def velocity(k: Constants, phi: Any, node: wp.vec4, place: NodeContext, touch: wp.vec4, aim: wp.vec4) -> wp.vec3:
        here = place
        v = k.decay * (wp.vec3(node[0], node[1], node[2]) / node[3]) - wp.vec3(0.0, 0.0, k.gravity * k.dt)
        v = node_velocity(v, here, phi)
        here.v = v
        here.touched = wp.min(1.0, touch[3] / node[3])
        if here.x[2] < 0.5 * k.cell:
            v = table_contact(k, v, table_friction(phi[0], here, phi))
        v = tool_contact(k, v, node[3], touch, aim, adhesion(0.0, here, phi))
        if wp.static(grips):
            v = pinch(k, v, node[3], touch, aim)
        return v

    return velocity


def node_work(velocity: WarpFunction) -> WarpFunction:
    """The velocity times its cotangent: the gradient of this number is the adjoint."""

    @wp.func
    def work(
        k: Constants, phi: Any, node: wp.vec4, place: NodeContext, touch: wp.vec4, aim: wp.vec4, v_bar: wp.vec3
    ) -> wp.float32:
        return wp.dot(v_bar, velocity(k, phi, node, place, touch, aim))

    return work


def hold_work(hold: WarpFunction) -> WarpFunction:
    """The position and velocity of `barrier` times their cotangents: the gradient of this number is the adjoint."""

    @wp.func
    def work(k: Constants, x: wp.vec3, v: wp.vec3, now: Any, then: Any, x_bar: wp.vec3, v_bar: wp.vec3) -> wp.float32:
        x_held, v_held = hold(k, x, v, now, then)
        return wp.dot(x_bar, x_held) + wp.dot(v_bar, v_held)

    return work
