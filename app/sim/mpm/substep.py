"""One substep of one particle or node: stress and P2G, grid operation, G2P; and its adjoint.

These are the pieces that kernels call in loops (`candidate_kernels`) or threads (`particle_kernels`), made for one
`Code`. Whatever is off the grid gives nothing to it and becomes NaN, which the rollout extends to its whole candidate.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast, final

import warp as wp

from app.sim.codegen.inputs import Types, types_of
from app.sim.codegen.kernel_codegen import Code, hold_work, node_function, node_work, particle_function, particle_work
from app.sim.codegen.tool_composition import barrier
from app.sim.constants import Constants
from app.sim.effect_composition import compose
from app.sim.effects.base import NodeContext, ParticleContext, WarpFunction
from app.sim.mpm.g2p import to_particles_adjoint_of, to_particles_of
from app.sim.mpm.nodes import node_adjoint_of, node_of
from app.sim.mpm.p2g import to_grid_adjoint_of, to_grid_by_body, to_grid_of
from app.sim.mpm.shared_transfer import WHOLE, Transfers


@final
@dataclass(frozen=True, kw_only=True)
class KernelFunctions:
    """Warp functions of one particle or node, and the types that they share; see `p2g`, `g2p` and `nodes`."""

    code: Code
    types: Types
    to_grid: WarpFunction
    to_particles: WarpFunction
    node: WarpFunction
    to_grid_adjoint: WarpFunction
    to_particles_adjoint: WarpFunction
    node_adjoint: WarpFunction
    worked: WarpFunction
    """Calls every function whose gradient the adjoints take: `worked(k, phi_grain, phi_node, pose, a, A)`."""


def make_pieces(code: Code, transfers: Transfers = WHOLE) -> KernelFunctions:
    """Kernel functions for scenes of this code."""
    types = types_of(code)
    hooks = compose(code.effects)
    hold = barrier(code.parts)
    held = hold_work(hold) if hold is not None else None
    velocity = node_function(code, hooks)
    node_worked = node_work(velocity)
    particles = [particle_function(code, law, hooks) for law in code.laws]
    works = [particle_work(particle) for particle in particles]
    to_grid = [to_grid_of(particle, types, transfers) for particle in particles]
    back: WarpFunction | None = None
    for body, (particle, work) in enumerate(zip(particles, works, strict=True)):
        back = to_grid_adjoint_of(particle, work, types, transfers, body, back)
        if body > 0:
            to_grid[0] = to_grid_by_body(to_grid[0], to_grid[body], body, types)
    return KernelFunctions(
        code=code,
        types=types,
        to_grid=to_grid[0],
        to_particles=to_particles_of(hold, types, transfers),
        node=node_of(velocity, types),
        to_grid_adjoint=cast(WarpFunction, back),
        to_particles_adjoint=to_particles_adjoint_of(held, types, transfers),
        node_adjoint=node_adjoint_of(node_worked, types),
        worked=_work(works, node_worked, held),
    )


def module_of(kind: str, code: Code) -> wp.Module:
    """Warp module for each kind of kernels, so that none is compiled that another platform or direction needs."""
    return wp.get_module(f"dipac_sim_{kind}_{code.name()}")


def adjoint_module_of(kind: str, code: Code, pieces: KernelFunctions) -> wp.Module:
    """A module whose kernels may call adjoints.

    Warp emits the adjoints of nested functions only where a differentiable kernel calls them; it is put in here.
    """
    module = module_of(kind, code)
    Inputs, worked = pieces.types.Inputs, pieces.worked

    @wp.kernel(module=module)
    def never_launched(k: Constants, a: Inputs, x: wp.array[wp.vec3], C: wp.array[wp.mat33], out: wp.array[float]):
        out[0] = worked(k, a.phi_grain[0], a.phi_node[0], a.tool[0, 0], x[0], C[0])

    return module


def _work(particles: Sequence[WarpFunction], node: WarpFunction, held: WarpFunction | None) -> WarpFunction:
    @wp.func
    def of_node(k: Constants, grain: Any, node_phi: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
        u = wp.vec4(a[0], a[1], a[2], wp.trace(A) + grain[0] + pose[0])
        return node(k, node_phi, u, NodeContext(), u, u, a)

    function = of_node
    for work in particles:
        function = _and_particle(function, work)
    return function if held is None else _and_held(function, held)


def _and_particle(before: WarpFunction, work: WarpFunction) -> WarpFunction:
    @wp.func
    def worked(k: Constants, grain: Any, node: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
        u = wp.vec4(a[0], a[1], a[2], 1.0)
        done = work(k, k.bodies[0], grain, ParticleContext(), a, a, A, A, pose, pose, a, A, 1.0, u, u, A)
        return before(k, grain, node, pose, a, A) + done

    return worked


def _and_held(before: WarpFunction, work: WarpFunction) -> WarpFunction:
    @wp.func
    def worked(k: Constants, grain: Any, node: Any, pose: Any, a: wp.vec3, A: wp.mat33) -> wp.float32:
        return before(k, grain, node, pose, a, A) + work(k, a, a, pose, pose, a, a)

    return worked
