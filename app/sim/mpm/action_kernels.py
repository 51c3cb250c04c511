"""The Warp kernels for a GPU: a whole action in one launch, whose blocks of threads wait for each other.

A substep is two passes, one over particles and one over nodes, and all threads of a candidate have to end one before
any begins the next. A launch a pass (`particle_kernels`) costs a few microseconds each; here the blocks of a candidate
count their arrivals in memory, and particles stay in registers meanwhile. Blocks take candidates in the order in which
they begin, so whoever waits does so for blocks that have begun or will when a candidate before theirs is done: more
candidates than fit on the GPU at once cannot wait for each other in a ring.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportConstantRedefinition=false

import functools
import os
from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.codegen.inputs import matter_of
from app.sim.codegen.kernel_codegen import Code
from app.sim.constants import BLOCK_NODES, Constants
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.nodes import active_node, clear, clear_both
from app.sim.mpm.particle_kernels import BLOCK_DIM, WARP_SIZE, back, forth, sum_over_warp
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


@final
@dataclass(frozen=True, kw_only=True)
class ActionKernels:
    """Whole actions of all candidates; launched over (B, `blocks` x BLOCK_DIM).

    Forward and adjoint are modules of their own: whoever takes no gradient does not wait for the longer one.
    """

    modules: tuple[wp.Module, wp.Module]
    pieces: KernelFunctions
    forward: wp.Kernel
    adjoint: wp.Kernel


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    __shared__ int number;
    if (threadIdx.x == 0)
        number = atomicAdd(arrived.data, 1);
    __syncthreads();
    return number;
#else
    return 0;
#endif
""")
def block_number(arrived: wp.array[wp.int32]) -> int:
    """Number of this block in the order in which blocks begin."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return threadIdx.x;
#else
    return 0;
#endif
""")
def thread_of_block() -> int:
    """Number of this thread in its block."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    __syncthreads();
    if (threadIdx.x == 0) {
        int* here = arrived.data + 1 + b;
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
    """Wait until blocks of candidate b have arrived `expected` times; what they wrote before is then seen."""
    ...


@functools.cache
def action_kernels(code: Code) -> ActionKernels:
    """Kernels for scenes of this code. Cheap: compilation happens at the first launch, or in warm-up."""
    pieces = make_pieces(code)
    forward_module, adjoint_module = module_of("action", code), adjoint_module_of("action_adjoint", code, pieces)
    for module in (forward_module, adjoint_module):
        module.options["fast_math"] = True
    types = pieces.types
    Inputs, PhiGrain, PhiNode, Pose = types.Inputs, types.PhiGrain, types.PhiNode, types.Pose
    p2g, g2p, node = pieces.to_grid, pieces.to_particles, pieces.node
    p2g_adjoint, g2p_adjoint, node_adjoint = pieces.to_grid_adjoint, pieces.to_particles_adjoint, pieces.node_adjoint
    grain_total, node_total, pose_total = (sum_over_warp(kind) for kind in (PhiGrain, PhiNode, Pose))
    holds = any(part.thin or part.grasps for part in code.parts)

    @wp.kernel(module=forward_module, enable_backward=False, launch_bounds=(BLOCK_DIM, int(os.environ.get('FB', '4'))))
    def forward(
        k: Constants, blocks: int, a: Inputs, start: wp.array4d[wp.vec4], h: wp.array4d[wp.vec4], grid: Grid
    ):
        number = block_number(grid.arrived)
        b = number // blocks
        threads = blocks * BLOCK_DIM
        t = (number % blocks) * BLOCK_DIM + thread_of_block()
        steps = a.tool.shape[1] - 1
        rows = h.shape[1]
        mine = t < h.shape[3]
        x = wp.vec3()
        v = wp.vec3()
        C = wp.mat33()
        F = wp.mat33()
        m = matter_of(k, t)
        if mine:
            motion = load_motion(start, b, 0, t)
            x = position(motion)
            v = velocity(motion)
            C = affine(motion)
            F = load_deformation(start, b, 0, t)
        for s in range(steps):
            w = forth(b, s)
            if mine:
                if rows > steps:
                    store_motion(h, b, s, t, x, v, C)
                    store_deformation(h, b, s, t, F)
                F = p2g(k, a, m, w, t, x, v, C, F, grid)
            wait_for_all(grid.arrived, b, (2 * s + 1) * blocks)
            old = forth(b, s + 1)
            for n in range(t, grid.count[b] * BLOCK_NODES, threads):
                i = active_node(n, b, grid)
                node(k, a, w, i, grid)
                clear(i, old.slot, s, grid)  # It has been taken, and is given again in the next substep.
            wait_for_all(grid.arrived, b, (2 * s + 2) * blocks)
            if mine:
                x, v, C = g2p(k, a, w, x, grid)
        if mine:
            store_motion(h, b, steps % rows, t, x, v, C)
            store_deformation(h, b, steps % rows, t, F)

    @wp.func
    def add_to_tool(b: int, s: int, now_bar: Pose, then_bar: Pose, tool_bar: wp.array2d[Pose]):
        now_all = pose_total(now_bar)
        then_all = pose_total(then_bar)
        if wp.dot(now_all, now_all) != 0.0:  # Few particles touch a tool; the others shall not queue for it.
            wp.atomic_add(tool_bar, b, s, now_all)
        if wp.dot(then_all, then_all) != 0.0:
            wp.atomic_add(tool_bar, b, s + 1, then_all)

    # Without a bound the compiler takes 255 registers, and a multiprocessor holds too few threads to hide its memory.
    @wp.kernel(module=adjoint_module, enable_backward=False, launch_bounds=(BLOCK_DIM, int(os.environ.get('AB', '4'))))
    def adjoint(
        k: Constants,
        blocks: int,
        a: Inputs,
        h: wp.array4d[wp.vec4],
        bars: wp.array4d[wp.vec4],
        grain_bar: wp.array2d[PhiGrain],
        node_bar: wp.array2d[PhiNode],
        tool_bar: wp.array2d[Pose],
        grid: Grid,
        grid_bars: GridBars,
    ):
        number = block_number(grid.arrived)
        b = number // blocks
        half = (blocks // 2) * BLOCK_DIM
        own = (number % blocks) * BLOCK_DIM + thread_of_block()
        t = own % half
        turns = own < half  # The other half gives to the grid again what was given one substep earlier.
        steps = a.tool.shape[1] - 1
        mine = t < h.shape[3]
        m = matter_of(k, t)
        x_bar = wp.vec3()
        v_bar = wp.vec3()
        C_bar = wp.mat33()
        F_bar = wp.mat33()
        grain_sum = PhiGrain()
        node_sum = PhiNode()
        if mine and turns:
            end = load_motion(bars, b, 0, t)
            x_bar = position(end)
            v_bar = velocity(end)
            C_bar = affine(end)
            F_bar = load_deformation(bars, b, 0, t)
        for later in range(steps + 2):
            s = steps - later
            if turns:
                if s + 1 < steps:
                    now_sum = Pose()
                    then_sum = Pose()
                    if mine:
                        x_bar, v_bar, C_bar, F_bar, phi_part, now_sum, then_sum = p2g_adjoint(
                            k, a, m, back(b, s + 1, steps), t, h, x_bar, F_bar, grid_bars
                        )
                        grain_sum += phi_part
                    add_to_tool(b, s + 1, now_sum, then_sum, tool_bar)
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
            elif s > 0 and mine:
                w = back(b, s - 1, steps)
                motion = load_motion(h, b, s - 1, t)
                F = load_deformation(h, b, s - 1, t)
                _F = p2g(k, a, m, w, t, position(motion), velocity(motion), affine(motion), F, grid)
            wait_for_all(grid.arrived, b, (2 * later + 1) * blocks)
            count = grid.count[b] * BLOCK_NODES
            if turns:
                if s >= 0 and s < steps:
                    for n in range(t, count, half):
                        node_sum += node_adjoint(k, a, back(b, s, steps), active_node(n, b, grid), grid, grid_bars)
            elif s >= 0:
                old = back(b, s + 1, steps)
                for n in range(t, count, half):
                    i = active_node(n, b, grid)
                    if s > 0:
                        node(k, a, back(b, s - 1, steps), i, grid)
                    clear_both(i, old.slot, old.stamp, grid, grid_bars)
            wait_for_all(grid.arrived, b, (2 * later + 2) * blocks)
        if turns:
            if mine:
                store_motion(bars, b, 0, t, x_bar, v_bar, C_bar)
                store_deformation(bars, b, 0, t, F_bar)
            grain_sum = grain_total(grain_sum)
            node_sum = node_total(node_sum)
            if t % WARP_SIZE == 0:
                grain_bar[b, t // WARP_SIZE] = grain_sum
                node_bar[b, t // WARP_SIZE] = node_sum

    return ActionKernels(modules=(forward_module, adjoint_module), pieces=pieces, forward=forward, adjoint=adjoint)
