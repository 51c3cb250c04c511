"""The Warp kernels: whole actions, a thread a candidate, for the CPU; single substeps, a thread a particle, for CUDA.

Both call the same pieces (`app.sim.substep`). On the CPU a candidate's few active blocks stay in its core's cache, and
an action is one launch. On a GPU a substep is two launches, which JAX records once as a graph: one over particles, which
takes what the grid said of the last substep and gives to the grid of the next, and one over nodes.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false

import functools
from dataclasses import dataclass
from typing import Any, final

import warp as wp

from app.sim.compiled import Code
from app.sim.constants import BLOCK_NODES, Constants
from app.sim.memory import Grid, GridBars
from app.sim.packed import (
    affine,
    load_deformation,
    load_motion,
    load_position,
    position,
    store_deformation,
    store_motion,
    velocity,
)
from app.sim.substep import Pieces, active_node, clear, clear_bars, make_pieces, matter_of

WARP_SIZE = 32


@final
@dataclass(frozen=True, kw_only=True)
class CandidateKernels:
    """Whole actions of candidate b in grid slot `slot`, one thread a launch."""

    module: wp.Module
    pieces: Pieces
    forward: wp.Kernel
    adjoint: wp.Kernel


@final
@dataclass(frozen=True, kw_only=True)
class ParticleKernels:
    """The two halves of substep s, each way; launched over (B, N) and (B, lanes), both whole numbers of warps."""

    module: wp.Module
    pieces: Pieces
    particles: wp.Kernel
    nodes: wp.Kernel
    particles_adjoint: wp.Kernel
    nodes_adjoint: wp.Kernel


def _module(kind: str, code: Code, pieces: Pieces) -> wp.Module:
    """A module of its own for each kind of kernels, so that no platform compiles the other's.

    Warp emits the adjoints of nested functions only where a differentiable kernel calls them; it is put in here.
    """
    module = wp.get_module(f"dipac_sim_{kind}_{code.name()}")
    Inputs, worked = pieces.Inputs, pieces.worked

    @wp.kernel(module=module)
    def never_launched(k: Constants, a: Inputs, x: wp.array[wp.vec3], C: wp.array[wp.mat33], out: wp.array[float]):
        out[0] = worked(k, a.phi_grain[0], a.phi_node[0], a.tool[0, 0], x[0], C[0])

    return module


@wp.func
def forget(slot: int, grid: Grid):
    """Before the next candidate in this slot, with a list and stamps of its own."""
    for block in range(grid.listed.shape[1]):
        grid.listed[slot, block] = 0
        grid.felt[slot, block] = 0
    grid.count[slot] = 0


@functools.cache
def candidate_kernels(code: Code) -> CandidateKernels:
    """For scenes of this code. Cheap: compilation happens at the first launch, or in warm-up."""
    pieces = make_pieces(code)
    module = _module("candidates", code, pieces)
    Inputs, PhiGrain, PhiNode, Pose = pieces.Inputs, pieces.PhiGrain, pieces.PhiNode, pieces.Pose
    p2g, g2p, node = pieces.to_grid, pieces.to_particles, pieces.node
    p2g_adjoint, g2p_adjoint, node_adjoint = pieces.to_grid_adjoint, pieces.to_particles_adjoint, pieces.node_adjoint

    @wp.func
    def to_grid(
        k: Constants, a: Inputs, b: int, s: int, read: int, write: int, slot: int, stamp: int, h: wp.array4d[wp.vec4], grid: Grid
    ):
        for p in range(h.shape[3]):
            m = matter_of(k, p)
            motion = load_motion(h, b, read, p)
            F = load_deformation(h, b, read, p)
            F_next = p2g(
                k, a, m, b, p, s, position(motion), velocity(motion), affine(motion), F, slot, slot, stamp, grid
            )
            if read != write:
                store_deformation(h, b, write, p, F_next)
        for n in range(grid.count[slot] * BLOCK_NODES):
            node(k, a, b, active_node(n, slot, grid), slot, stamp, grid)

    @wp.kernel(module=module, enable_backward=False)
    def forward(k: Constants, a: Inputs, b: int, slot: int, start: wp.array4d[wp.vec4], h: wp.array4d[wp.vec4], grid: Grid):
        forget(slot, grid)
        for p in range(h.shape[3]):
            motion = load_motion(start, b, 0, p)
            store_motion(h, b, 0, p, position(motion), velocity(motion), affine(motion))
            store_deformation(h, b, 0, p, load_deformation(start, b, 0, p))
        rows = h.shape[1]
        for s in range(a.tool.shape[1] - 1):
            read = s % rows
            write = (s + 1) % rows
            to_grid(k, a, b, s, read, write, slot, s + 1, h, grid)
            for p in range(h.shape[3]):
                x, v, C = g2p(k, a, b, s, load_position(h, b, read, p), slot, grid)
                store_motion(h, b, write, p, x, v, C)
            for n in range(grid.count[slot] * BLOCK_NODES):
                clear(active_node(n, slot, grid), slot, s + 1, grid)

    @wp.kernel(module=module, enable_backward=False)
    def adjoint(
        k: Constants,
        a: Inputs,
        b: int,
        slot: int,
        h: wp.array4d[wp.vec4],
        bars: wp.array4d[wp.vec4],
        grain_bar: wp.array2d[PhiGrain],
        node_bar: wp.array2d[PhiNode],
        tool_bar: wp.array2d[Pose],
        grid: Grid,
        grid_bars: GridBars,
    ):
        forget(slot, grid)
        grain_sum = PhiGrain()
        node_sum = PhiNode()
        steps = a.tool.shape[1] - 1
        for back in range(steps):
            s = steps - 1 - back
            stamp = back + 1
            now_sum = Pose()
            then_sum = Pose()
            to_grid(k, a, b, s, s, s, slot, stamp, h, grid)
            for p in range(h.shape[3]):
                bar = load_motion(bars, b, 0, p)
                x = load_position(h, b, s, p)
                x_bar, now_part, then_part = g2p_adjoint(
                    k, a, b, s, x, position(bar), velocity(bar), affine(bar), slot, grid, grid_bars
                )
                store_motion(bars, b, 0, p, x_bar, wp.vec3(), wp.mat33())
                now_sum += now_part
                then_sum += then_part
            for n in range(grid.count[slot] * BLOCK_NODES):
                node_sum += node_adjoint(k, a, b, active_node(n, slot, grid), slot, stamp, grid, grid_bars)
            for p in range(h.shape[3]):
                x_bar, v_bar, C_bar, F_bar, phi_part, now_part, then_part = p2g_adjoint(
                    k, a, matter_of(k, p), b, p, s, slot, h, load_position(bars, b, 0, p), load_deformation(bars, b, 0, p), grid_bars
                )
                store_motion(bars, b, 0, p, x_bar, v_bar, C_bar)
                store_deformation(bars, b, 0, p, F_bar)
                grain_sum += phi_part
                now_sum += now_part
                then_sum += then_part
            tool_bar[b, s] = tool_bar[b, s] + now_sum
            tool_bar[b, s + 1] = tool_bar[b, s + 1] + then_sum
            for n in range(grid.count[slot] * BLOCK_NODES):
                i = active_node(n, slot, grid)
                clear(i, slot, stamp, grid)
                clear_bars(i, slot, grid_bars)
        grain_bar[b, 0] = grain_sum
        node_bar[b, 0] = node_sum

    return CandidateKernels(module=module, pieces=pieces, forward=forward, adjoint=adjoint)


def _sum_over_warp(kind: Any, length: int) -> Any:
    """A function that gives the first thread of a GPU's warp the sum over its threads, and the others zero.

    On the CPU threads run one after the other, and each keeps its own.
    """

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


SLOTS = 2
SLOTS_BACK = 3
"""Grids a candidate has on a GPU: one that is given, one that is taken and, backwards, one that is cleared meanwhile."""


@wp.func
def forth(b: int, s: int) -> int:
    """The slot of candidate b in substep s."""
    return 2 * b + s % 2


@wp.func
def back(b: int, s: int) -> int:
    """On the way back, where s may be -1."""
    return 3 * b + (s + 3) % 3


@functools.cache
def particle_kernels(code: Code) -> ParticleKernels:
    """For scenes of this code. Cheap: compilation happens at the first launch, or in warm-up."""
    pieces = make_pieces(code)
    module = _module("particles", code, pieces)
    Inputs, PhiGrain, PhiNode, Pose = pieces.Inputs, pieces.PhiGrain, pieces.PhiNode, pieces.Pose
    p2g, g2p, node = pieces.to_grid, pieces.to_particles, pieces.node
    p2g_adjoint, g2p_adjoint, node_adjoint = pieces.to_grid_adjoint, pieces.to_particles_adjoint, pieces.node_adjoint
    grain_total = _sum_over_warp(PhiGrain, len(PhiGrain()))
    node_total = _sum_over_warp(PhiNode, len(PhiNode()))
    pose_total = _sum_over_warp(Pose, len(Pose()))
    holds = any(part.thin for part in code.parts)
    module.options["fast_math"] = True

    kernel = wp.kernel(module=module, enable_backward=False)

    @kernel
    def particles(
        k: Constants, s: int, a: Inputs, start: wp.array4d[wp.vec4], h: wp.array4d[wp.vec4], grid: Grid
    ):
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
                x, v, C = g2p(k, a, b, s - 1, load_position(h, b, (s - 1) % rows, p), forth(b, s - 1), grid)
            else:
                motion = load_motion(start, b, 0, p)
                x = position(motion)
                v = velocity(motion)
                C = affine(motion)
                F = load_deformation(start, b, 0, p)
                store_deformation(h, b, now, p, F)
            store_motion(h, b, now, p, x, v, C)
            if s < a.tool.shape[1] - 1:
                F_next = p2g(k, a, m, b, p, s, x, v, C, F, b, forth(b, s), s + 1, grid)
                store_deformation(h, b, (s + 1) % rows, p, F_next)

    @kernel
    def nodes(k: Constants, s: int, lanes: int, a: Inputs, grid: Grid):
        b, t = wp.tid()
        if t < lanes:
            slot = forth(b, s)
            for n in range(t, grid.count[b] * BLOCK_NODES, lanes):
                node(k, a, b, active_node(n, b, grid), slot, s + 1, grid)
        else:
            old = forth(b, s + 1)
            for n in range(t - lanes, grid.count[b] * BLOCK_NODES, lanes):
                clear(active_node(n, b, grid), old, s, grid)

    @wp.func
    def again(
        k: Constants, a: Inputs, b: int, p: int, s: int, stamp: int, h: wp.array4d[wp.vec4], grid: Grid
    ):
        """Give to the grid what substep s gave."""
        motion = load_motion(h, b, s, p)
        F = load_deformation(h, b, s, p)
        m = matter_of(k, p)
        _F = p2g(
            k, a, m, b, p, s, position(motion), velocity(motion), affine(motion), F, b, back(b, s), stamp, grid
        )

    @kernel
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
            p = t
            mine = p < h.shape[3]
            x_bar = wp.vec3()
            v_bar = wp.vec3()
            C_bar = wp.mat33()
            F_bar = wp.mat33()
            if mine:
                x_bar = load_position(bars, b, 0, p)
                F_bar = load_deformation(bars, b, 0, p)
            if s + 1 < steps:
                phi_sum = PhiGrain()
                now_sum = Pose()
                then_sum = Pose()
                if mine:
                    x_bar, v_bar, C_bar, F_bar, phi_sum, now_sum, then_sum = p2g_adjoint(
                        k, a, matter_of(k, p), b, p, s + 1, back(b, s + 1), h, x_bar, F_bar, grid_bars
                    )
                phi_sum = grain_total(phi_sum)
                if wp.dot(phi_sum, phi_sum) != 0.0:
                    grain_bar[b, t // WARP_SIZE] = grain_bar[b, t // WARP_SIZE] + phi_sum
                add_to_tool(b, s + 1, now_sum, then_sum, tool_bar)
            elif mine:
                end = load_motion(bars, b, 0, p)
                v_bar = velocity(end)
                C_bar = affine(end)
            if s >= 0 and s < steps:
                now_part = Pose()
                then_part = Pose()
                if mine:
                    x_bar, now_part, then_part = g2p_adjoint(
                        k, a, b, s, load_position(h, b, s, p), x_bar, v_bar, C_bar, back(b, s), grid, grid_bars
                    )
                if wp.static(holds):
                    add_to_tool(b, s, now_part, then_part, tool_bar)
            if mine and s < steps:
                store_motion(bars, b, 0, p, x_bar, v_bar, C_bar)
                store_deformation(bars, b, 0, p, F_bar)
        elif s > 0:
            p_again = t - threads
            if p_again < h.shape[3]:
                again(k, a, b, p_again, s - 1, steps - s + 1, h, grid)

    @wp.func
    def add_to_tool(b: int, s: int, now_bar: Pose, then_bar: Pose, tool_bar: wp.array2d[Pose]):
        now_all = pose_total(now_bar)
        then_all = pose_total(then_bar)
        if wp.dot(now_all, now_all) != 0.0:  # Few particles touch a tool; the others shall not queue for it.
            wp.atomic_add(tool_bar, b, s, now_all)
        if wp.dot(then_all, then_all) != 0.0:
            wp.atomic_add(tool_bar, b, s + 1, then_all)

    @kernel
    def nodes_adjoint(
        k: Constants, s: int, lanes: int, a: Inputs, node_bar: wp.array2d[PhiNode], grid: Grid, grid_bars: GridBars
    ):
        b, t = wp.tid()
        stamp = a.tool.shape[1] - 1 - s  # Of substep s; those before it, which come later, have greater ones.
        if t < lanes:
            slot = back(b, s)
            phi_sum = PhiNode()
            if stamp > 0:
                for n in range(t, grid.count[b] * BLOCK_NODES, lanes):
                    phi_sum += node_adjoint(k, a, b, active_node(n, b, grid), slot, stamp, grid, grid_bars)
            phi_sum = node_total(phi_sum)
            if wp.dot(phi_sum, phi_sum) != 0.0:
                node_bar[b, t // WARP_SIZE] = node_bar[b, t // WARP_SIZE] + phi_sum
        elif t < 2 * lanes:
            before = back(b, s - 1)
            if s > 0:
                for n in range(t - lanes, grid.count[b] * BLOCK_NODES, lanes):
                    node(k, a, b, active_node(n, b, grid), before, stamp + 1, grid)
        else:
            old = back(b, s + 1)
            for n in range(t - 2 * lanes, grid.count[b] * BLOCK_NODES, lanes):
                i = active_node(n, b, grid)
                clear(i, old, stamp - 1, grid)
                clear_bars(i, old, grid_bars)

    return ParticleKernels(
        module=module,
        pieces=pieces,
        particles=particles,
        nodes=nodes,
        particles_adjoint=particles_adjoint,
        nodes_adjoint=nodes_adjoint,
    )
