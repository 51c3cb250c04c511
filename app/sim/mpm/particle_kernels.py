"""The Warp kernels for a GPU: half a substep each, a thread a particle or a few nodes.

A substep is two launches, which JAX records once as a graph. One is over particles: each takes what the grid says of
the last substep and gives to the grid of the next. The other is over nodes. What is independent of each other is done
by different threads of one launch, for a GPU waits for memory most of the time and can do other things meanwhile.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportConstantRedefinition=false

import functools
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.codegen.inputs import Place, matter_of, place_of
from app.sim.codegen.kernel_codegen import Code
from app.sim.constants import BLOCK_NODES, Constants
from app.sim.effects.base import WarpFunction
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.nodes import active_node, clear, clear_both
from app.sim.mpm.simd_layout import (
    affine,
    load_deformation,
    load_motion,
    load_position,
    position,
    store_deformation,
    store_motion,
    velocity,
)
from app.sim.mpm.substep import KernelFunctions, adjoint_module_of, make_pieces

WARP_SIZE = 32

BLOCK_DIM = 128
"""Threads of a block."""

SLOTS = 2
SLOTS_BACK = 3
"""Grids of a candidate: one that is written, one that is read and, in the backward pass, one that is cleared."""


@final
@dataclass(frozen=True, kw_only=True)
class ParticleKernels:
    """The two halves of substep s, each way.

    Launched over (B, groups of N threads) and (B, groups of `lanes`), both whole numbers of warps: one group for
    `particles`, two for `nodes` and `particles_adjoint`, three for `nodes_adjoint`.
    """

    modules: tuple[wp.Module]
    pieces: KernelFunctions
    particles: wp.Kernel
    nodes: wp.Kernel
    particles_adjoint: wp.Kernel
    nodes_adjoint: wp.Kernel


@wp.func
def forth(b: int, s: int) -> Place:
    """Candidate b in substep s, on the way forth."""
    return place_of(b, s, b, SLOTS * b + s % SLOTS, s + 1)


@wp.func
def back(b: int, s: int, steps: int) -> Place:
    """Place in the backward pass, where s may be -1: later launches have greater stamps."""
    return place_of(b, s, b, SLOTS_BACK * b + (s + SLOTS_BACK) % SLOTS_BACK, steps - s)


@functools.cache
def particle_kernels(code: Code) -> ParticleKernels:
    """Kernels for scenes of this code. Cheap: compilation happens at the first launch, or in warm-up."""
    pieces = make_pieces(code)
    module = adjoint_module_of("particles", code, pieces)
    module.options["fast_math"] = True
    types = pieces.types
    Inputs, PhiGrain, PhiNode, Pose = types.Inputs, types.PhiGrain, types.PhiNode, types.Pose
    p2g, g2p, node = pieces.to_grid, pieces.to_particles, pieces.node
    p2g_adjoint, g2p_adjoint, node_adjoint = pieces.to_grid_adjoint, pieces.to_particles_adjoint, pieces.node_adjoint
    grain_total, node_total, add_to_tool = sum_over_warp(PhiGrain), sum_over_warp(PhiNode), add_to_tool_of(Pose)
    holds = any(part.thin or part.grasps for part in code.parts)
    kernel = wp.kernel(module=module, enable_backward=False)

    @kernel
    def particles(k: Constants, s: int, a: Inputs, start: wp.array4d[wp.vec4], h: wp.array4d[wp.vec4], grid: Grid):
        b, p = wp.tid()
        rows = h.shape[1]
        if p < h.shape[3]:
            m = matter_of(k, p)
            x = wp.vec3()
            v = wp.vec3()
            C = wp.mat33()
            F = wp.mat33()
            now = s % rows
            if s > 0:
                F = load_deformation(h, b, now, p)
                x, v, C = g2p(k, a, forth(b, s - 1), load_position(h, b, (s - 1) % rows, p), grid)
            else:
                motion = load_motion(start, b, 0, p)
                x = position(motion)
                v = velocity(motion)
                C = affine(motion)
                F = load_deformation(start, b, 0, p)
                store_deformation(h, b, now, p, F)
            store_motion(h, b, now, p, x, v, C)
            if s < a.tool.shape[1] - 1:
                F_next = p2g(k, a, m, forth(b, s), p, x, v, C, F, grid)
                store_deformation(h, b, (s + 1) % rows, p, F_next)

    @kernel
    def nodes(k: Constants, s: int, lanes: int, a: Inputs, grid: Grid):
        b, t = wp.tid()
        if t < lanes:
            for n in range(t, grid.count[b] * BLOCK_NODES, lanes):
                node(k, a, forth(b, s), active_node(n, b, grid), grid)
        else:  # The grid of the last substep has been taken, and is given again in the next.
            old = forth(b, s + 1)
            for n in range(t - lanes, grid.count[b] * BLOCK_NODES, lanes):
                clear(active_node(n, b, grid), old.slot, s, grid)

    @wp.func
    def again(k: Constants, a: Inputs, w: Place, p: int, h: wp.array4d[wp.vec4], grid: Grid):
        """Give to the grid what was given in that substep."""
        motion = load_motion(h, w.b, w.s, p)
        F = load_deformation(h, w.b, w.s, p)
        _F = p2g(k, a, matter_of(k, p), w, p, position(motion), velocity(motion), affine(motion), F, grid)

    # Without a bound the compiler takes 255 registers, and a multiprocessor holds too few threads to hide its memory.
    @wp.kernel(module=module, enable_backward=False, launch_bounds=(BLOCK_DIM, 3))
    def particles_adjoint(
        k: Constants,
        s: int,
        threads: int,
        a: Inputs,
        h: wp.array4d[wp.vec4],
        bars: wp.array4d[wp.vec4],
        grain_bar: wp.array2d[PhiGrain],
        tool_bar: wp.array2d[Pose],
        grid: Grid,
        grid_bars: GridBars,
    ):
        b, t = wp.tid()
        steps = a.tool.shape[1] - 1
        if t < threads:
            mine = t < h.shape[3]
            x_bar = wp.vec3()
            v_bar = wp.vec3()
            C_bar = wp.mat33()
            F_bar = wp.mat33()
            if mine:
                x_bar = load_position(bars, b, 0, t)
                F_bar = load_deformation(bars, b, 0, t)
            if s + 1 < steps:
                phi_sum = PhiGrain()
                now_sum = Pose()
                then_sum = Pose()
                if mine:
                    x_bar, v_bar, C_bar, F_bar, phi_sum, now_sum, then_sum = p2g_adjoint(
                        k, a, matter_of(k, t), back(b, s + 1, steps), t, h, x_bar, F_bar, grid_bars
                    )
                phi_sum = grain_total(phi_sum)
                if wp.dot(phi_sum, phi_sum) != 0.0:
                    grain_bar[b, t // WARP_SIZE] = grain_bar[b, t // WARP_SIZE] + phi_sum
                add_to_tool(b, s + 1, now_sum, then_sum, tool_bar)
            elif mine:
                end = load_motion(bars, b, 0, t)
                v_bar = velocity(end)
                C_bar = affine(end)
            if s >= 0 and s < steps:
                now_part = Pose()
                then_part = Pose()
                if mine:
                    x_bar, now_part, then_part = g2p_adjoint(
                        k,
                        a,
                        back(b, s, steps),
                        load_position(h, b, s, t),
                        x_bar,
                        v_bar,
                        C_bar,
                        grid,
                        grid_bars,
                    )
                if wp.static(holds):
                    add_to_tool(b, s, now_part, then_part, tool_bar)
            if mine and s < steps:
                store_motion(bars, b, 0, t, x_bar, v_bar, C_bar)
                store_deformation(bars, b, 0, t, F_bar)
        elif s > 0 and t - threads < h.shape[3]:
            again(k, a, back(b, s - 1, steps), t - threads, h, grid)

    @kernel
    def nodes_adjoint(
        k: Constants, s: int, lanes: int, a: Inputs, node_bar: wp.array2d[PhiNode], grid: Grid, grid_bars: GridBars
    ):
        b, t = wp.tid()
        steps = a.tool.shape[1] - 1
        if t < lanes:
            phi_sum = PhiNode()
            if s < steps:
                for n in range(t, grid.count[b] * BLOCK_NODES, lanes):
                    phi_sum += node_adjoint(k, a, back(b, s, steps), active_node(n, b, grid), grid, grid_bars)
            phi_sum = node_total(phi_sum)
            if wp.dot(phi_sum, phi_sum) != 0.0:
                node_bar[b, t // WARP_SIZE] = node_bar[b, t // WARP_SIZE] + phi_sum
        elif t < 2 * lanes:
            if s > 0:
                for n in range(t - lanes, grid.count[b] * BLOCK_NODES, lanes):
                    node(k, a, back(b, s - 1, steps), active_node(n, b, grid), grid)
        else:
            old = back(b, s + 1, steps)
            for n in range(t - 2 * lanes, grid.count[b] * BLOCK_NODES, lanes):
                clear_both(active_node(n, b, grid), old.slot, old.stamp, grid, grid_bars)

    return ParticleKernels(
        modules=(module,),
        pieces=pieces,
        particles=particles,
        nodes=nodes,
        particles_adjoint=particles_adjoint,
        nodes_adjoint=nodes_adjoint,
    )


def add_to_tool_of(Pose: Any) -> WarpFunction:
    """`add_to_tool(b, s, now_bar, then_bar, tool_bar)`: the cotangents of the tools before and after substep s."""
    total = sum_over_warp(Pose)

    @wp.func
    def add_to_tool(b: int, s: int, now_bar: Pose, then_bar: Pose, tool_bar: wp.array2d[Pose]):
        now_all = total(now_bar)
        then_all = total(then_bar)
        if wp.dot(now_all, now_all) != 0.0:  # Few particles touch a tool; the others shall not queue for it.
            wp.atomic_add(tool_bar, b, s, now_all)
        if wp.dot(then_all, then_all) != 0.0:
            wp.atomic_add(tool_bar, b, s + 1, then_all)

    return add_to_tool


def sum_over_warp(kind: Any) -> Any:
    """A function that gives the first thread of a GPU's warp the sum over its threads, and the others zero.

    On the CPU threads run one after the other, and each keeps its own.
    """
    length = len(kind())

    @wp.func_native(
        f"""
    #if defined(__CUDA_ARCH__)
        #pragma unroll
        for (int c = 0; c < {length}; c++)
            #pragma unroll
            for (int lane = 16; lane > 0; lane /= 2)
                a[c] += __shfl_xor_sync(0xffffffff, a[c], lane);
        if ((threadIdx.x & 31) != 0)
            for (int c = 0; c < {length}; c++)
                a[c] = 0.0f;
    #endif
        return a;
    """
    )
    def total(a: kind) -> kind: ...

    return total
