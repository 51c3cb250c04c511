"""The Warp kernels for a GPU: whole actions in one launch, whose blocks of threads wait for each other.

A substep is two passes, one over particles and one over nodes, and every thread of a candidate ends one before any
begins the next. A launch a pass (`particle_kernels`) costs microseconds, and particles go through memory; here the
blocks of a candidate count their arrivals in memory, and particles stay in registers. Blocks that wait hold their
place, so all have to be on the GPU at the same time: `RESIDENT` on each of its multiprocessors.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportConstantRedefinition=false

import functools
from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.codegen.inputs import matter_of
from app.sim.codegen.kernel_codegen import Code
from app.sim.constants import BLOCK_NODES, Constants
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.nodes import active_node, clear, clear_both
from app.sim.mpm.particle_kernels import BLOCK_DIM, WARP_SIZE, add_to_tool_of, back, forth, sum_over_warp
from app.sim.mpm.shared_transfer import BY_PLANES, WHOLE
from app.sim.mpm.simd_intrinsics import ABREAST
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
from app.sim.mpm.substep import KernelFunctions, adjoint_module_of, make_pieces, module_of

RESIDENT = 4
"""Blocks that a multiprocessor holds at the same time: their kernels may take 128 of its registers a thread."""


@final
@dataclass(frozen=True, kw_only=True)
class ActionKernels:
    """Whole actions of B candidates, `blocks` of BLOCK_DIM threads each: launched over (B, blocks x BLOCK_DIM).

    With `blocks` as many as particles need, `adjoint` has the same threads turn a substep back and compute the grid of
    the one before it again; with twice as many, these are threads of their own. Forward and adjoint are modules of
    their own: whoever takes no gradient does not wait for the longer one.
    """

    modules: tuple[wp.Module, wp.Module]
    pieces: KernelFunctions
    forward: wp.Kernel
    adjoint: wp.Kernel
    by_planes: bool

    def blocks(self, particles: int) -> int:
        """Blocks of a candidate."""
        warps = -(-particles // (ABREAST if self.by_planes else WARP_SIZE))
        return -(-warps * WARP_SIZE // BLOCK_DIM)


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (threadIdx.x == 0) {
        int* here = arrived.data + b;
        int seen;
        asm volatile("red.release.gpu.global.add.s32 [%0], 1;" :: "l"(here) : "memory");
        do {
            asm volatile("ld.acquire.gpu.global.s32 %0, [%1];" : "=r"(seen) : "l"(here) : "memory");
        } while (seen < expected);
    }
    __syncthreads();
#endif
""")
def wait_for_all(arrived: wp.array[wp.int32], b: int, expected: int):
    """Wait until blocks of candidate b have arrived `expected` times: what they wrote before that is seen after it."""


@functools.cache
def action_kernels(code: Code, *, by_planes: bool) -> ActionKernels:
    """Kernels for scenes of this code. Cheap: compilation happens at the first launch, or in warm-up.

    `by_planes`: three threads a particle (`shared_transfer`), of which the first speaks for all.
    """
    pieces = make_pieces(code, BY_PLANES if by_planes else WHOLE)
    kind = "action_by_planes" if by_planes else "action"
    forward_module, adjoint_module = module_of(kind, code), adjoint_module_of(f"{kind}_adjoint", code, pieces)
    for module in (forward_module, adjoint_module):
        module.options["fast_math"] = True
    types = pieces.types
    Inputs, PhiGrain, PhiNode, Pose = types.Inputs, types.PhiGrain, types.PhiNode, types.Pose
    p2g, g2p, node = pieces.to_grid, pieces.to_particles, pieces.node
    p2g_adjoint, g2p_adjoint, node_adjoint = pieces.to_grid_adjoint, pieces.to_particles_adjoint, pieces.node_adjoint
    grain_total, node_total, add_to_tool = sum_over_warp(PhiGrain), sum_over_warp(PhiNode), add_to_tool_of(Pose)
    holds = any(part.thin or part.grasps for part in code.parts)

    @wp.func
    def particle_of(thread: int, count: int) -> int:
        """Number of the particle of a thread, or -1."""
        p = thread
        if wp.static(by_planes):
            lane = thread % WARP_SIZE
            p = (thread // WARP_SIZE) * ABREAST + lane % ABREAST
            if lane >= 3 * ABREAST:
                p = count
        if p >= count:
            p = -1
        return p

    @wp.func
    def leads(thread: int) -> bool:
        """True for the thread that speaks for its particle."""
        if wp.static(by_planes):
            return thread % WARP_SIZE < ABREAST
        return True

    @wp.kernel(module=forward_module, enable_backward=False, launch_bounds=(BLOCK_DIM, RESIDENT))
    def forward(k: Constants, blocks: int, a: Inputs, start: wp.array4d[wp.vec4], h: wp.array4d[wp.vec4], grid: Grid):
        b, thread = wp.tid()
        threads = blocks * BLOCK_DIM
        p = particle_of(thread, h.shape[3])
        writes = p >= 0 and leads(thread)
        steps = a.tool.shape[1] - 1
        rows = h.shape[1]
        x = wp.vec3()
        v = wp.vec3()
        C = wp.mat33()
        F = wp.mat33()
        m = matter_of(k, p)
        if p >= 0:
            motion = load_motion(start, b, 0, p)
            x = position(motion)
            v = velocity(motion)
            C = affine(motion)
            F = load_deformation(start, b, 0, p)
        for s in range(steps):
            w = forth(b, s)
            if writes and rows > steps:
                store_motion(h, b, s, p, x, v, C)
                store_deformation(h, b, s, p, F)
            if p >= 0:
                F = p2g(k, a, m, w, p, x, v, C, F, grid)
            wait_for_all(grid.arrived, b, (2 * s + 1) * blocks)
            old = forth(b, s + 1)
            for n in range(thread, grid.count[b] * BLOCK_NODES, threads):
                i = active_node(n, b, grid)
                node(k, a, w, i, grid)
                clear(i, old.slot, s, grid)  # It has been taken, and is given again in the next substep.
            wait_for_all(grid.arrived, b, (2 * s + 2) * blocks)
            if p >= 0:
                x, v, C = g2p(k, a, w, x, grid)
        if writes:
            store_motion(h, b, steps % rows, p, x, v, C)
            store_deformation(h, b, steps % rows, p, F)

    @wp.kernel(module=adjoint_module, enable_backward=False, launch_bounds=(BLOCK_DIM, RESIDENT))
    def adjoint(
        k: Constants,
        blocks: int,
        own: int,
        a: Inputs,
        h: wp.array4d[wp.vec4],
        bars: wp.array4d[wp.vec4],
        grain_bar: wp.array2d[PhiGrain],
        node_bar: wp.array2d[PhiNode],
        tool_bar: wp.array2d[Pose],
        grid: Grid,
        grid_bars: GridBars,
    ):
        b, thread = wp.tid()
        turns = thread < own
        second = thread - (blocks * BLOCK_DIM - own)  # Number among those who compute again: the last, or all.
        p = particle_of(thread, h.shape[3])
        again = -1
        if second >= 0:
            again = particle_of(second, h.shape[3])
        writes = turns and p >= 0 and leads(thread)
        steps = a.tool.shape[1] - 1
        x_bar = wp.vec3()
        v_bar = wp.vec3()
        C_bar = wp.mat33()
        F_bar = wp.mat33()
        grain_sum = PhiGrain()
        node_sum = PhiNode()
        if turns and p >= 0:
            end = load_motion(bars, b, 0, p)
            x_bar = position(end)
            v_bar = velocity(end)
            C_bar = affine(end)
            F_bar = load_deformation(bars, b, 0, p)
        for later in range(steps + 2):
            s = steps - later
            if turns:
                if s + 1 < steps:
                    now_sum = Pose()
                    then_sum = Pose()
                    if p >= 0:
                        x_bar, v_bar, C_bar, F_bar, phi_part, now_part, then_part = p2g_adjoint(
                            k, a, matter_of(k, p), back(b, s + 1, steps), p, h, x_bar, F_bar, grid_bars
                        )
                        if writes:
                            grain_sum += phi_part
                            now_sum = now_part
                            then_sum = then_part
                    add_to_tool(b, s + 1, now_sum, then_sum, tool_bar)
                if s >= 0 and s < steps:
                    now_sum = Pose()
                    then_sum = Pose()
                    if p >= 0:
                        x = load_position(h, b, s, p)
                        x_bar, now_part, then_part = g2p_adjoint(
                            k, a, back(b, s, steps), x, x_bar, v_bar, C_bar, grid, grid_bars
                        )
                        if writes:
                            now_sum = now_part
                            then_sum = then_part
                    if wp.static(holds):
                        add_to_tool(b, s, now_sum, then_sum, tool_bar)
            if s > 0 and again >= 0:
                motion = load_motion(h, b, s - 1, again)
                F = load_deformation(h, b, s - 1, again)
                w = back(b, s - 1, steps)
                m = matter_of(k, again)
                _F = p2g(k, a, m, w, again, position(motion), velocity(motion), affine(motion), F, grid)
            wait_for_all(grid.arrived, b, (2 * later + 1) * blocks)
            nodes = grid.count[b] * BLOCK_NODES
            if turns and s >= 0 and s < steps:
                for n in range(thread, nodes, own):
                    node_sum += node_adjoint(k, a, back(b, s, steps), active_node(n, b, grid), grid, grid_bars)
            if second >= 0 and s >= 0:
                old = back(b, s + 1, steps)
                for n in range(second, nodes, own):
                    i = active_node(n, b, grid)
                    if s > 0:
                        node(k, a, back(b, s - 1, steps), i, grid)
                    clear_both(i, old.slot, old.stamp, grid, grid_bars)
            wait_for_all(grid.arrived, b, (2 * later + 2) * blocks)
        if writes:
            store_motion(bars, b, 0, p, x_bar, v_bar, C_bar)
            store_deformation(bars, b, 0, p, F_bar)
        if turns:
            grain_sum = grain_total(grain_sum)
            node_sum = node_total(node_sum)
            if thread % WARP_SIZE == 0:
                grain_bar[b, thread // WARP_SIZE] = grain_sum
                node_bar[b, thread // WARP_SIZE] = node_sum

    return ActionKernels(
        modules=(forward_module, adjoint_module),
        pieces=pieces,
        forward=forward,
        adjoint=adjoint,
        by_planes=by_planes,
    )
