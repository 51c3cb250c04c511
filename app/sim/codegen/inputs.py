"""Kernel arguments besides constants and memory, as Warp structs; and a thread's place in memory."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false

from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.codegen.kernel_codegen import Code
from app.sim.constants import Constants, Matter
from app.sim.effect_composition import columns
from app.sim.effects.base import ParticleContext
from app.sim.model.params import NOMINAL_PHYSICS


@wp.struct
class Place:
    """Candidate `b` in substep `s`: the list of its active blocks, its grid's slot, and the stamp of this use of it."""

    b: wp.int32
    s: wp.int32
    listing: wp.int32
    slot: wp.int32
    stamp: wp.int32


@final
@dataclass(frozen=True, kw_only=True)
class Types:
    """Vectors as long as a `Code` needs them: of phi as particles and nodes see it, and of the tools' coordinates.

    `Inputs`: a struct of arrays, `phi_grain` and `phi_node` (B,), `tool` (B, T), `label` (B, N), `time` (B,); and
    `every`, 1 where every effect is to be called.
    """

    PhiGrain: type
    PhiNode: type
    Pose: type
    Inputs: Any


def types_of(code: Code) -> Types:
    """Vector types for scenes of this code."""
    lengths = columns(NOMINAL_PHYSICS, code.effects)
    PhiGrain = wp.types.vector(length=len(lengths.grain), dtype=float)
    PhiNode = wp.types.vector(length=len(lengths.node), dtype=float)
    Pose = wp.types.vector(length=max(1, code.coordinates), dtype=float)

    @wp.struct
    class Inputs:
        phi_grain: wp.array[PhiGrain]
        phi_node: wp.array[PhiNode]
        tool: wp.array2d[Pose]
        label: wp.array2d[wp.vec4]
        time: wp.array[float]
        every: int

    return Types(PhiGrain=PhiGrain, PhiNode=PhiNode, Pose=Pose, Inputs=Inputs)


@wp.func
def place_of(b: int, s: int, listing: int, slot: int, stamp: int) -> Place:
    """The place with these values."""
    w = Place()
    w.b = b
    w.s = s
    w.listing = listing
    w.slot = slot
    w.stamp = stamp
    return w


@wp.func
def grain_of(k: Constants, label: wp.vec4, time: float, every: int) -> ParticleContext:
    """A particle as effects see it."""
    grain = ParticleContext()
    grain.label = label
    grain.time = time
    grain.dt = k.dt
    grain.every = every
    return grain


@wp.func
def matter_of(k: Constants, p: int) -> Matter:
    """The body that particle `p` belongs to."""
    m = k.bodies[0]
    for body in range(1, k.bodies.shape[0]):
        if p >= k.bodies[body].first:
            m = k.bodies[body]
    return m
