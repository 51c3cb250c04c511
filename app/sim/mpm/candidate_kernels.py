"""The Warp kernels for a CPU: whole actions, a thread a candidate, whose few active blocks stay in its core's cache."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false

import functools
from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.codegen.inputs import Place, matter_of, place_of
from app.sim.codegen.kernel_codegen import Code
from app.sim.constants import BLOCK_NODES, Constants
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
from app.sim.mpm.substep import KernelFunctions, adjoint_module_of, make_pieces, module_of


@final
@dataclass(frozen=True, kw_only=True)
class CandidateKernels:
    """Whole actions of candidate b in grid slot `slot`, one thread a launch.

    Forward and adjoint are modules of their own: whoever takes no gradient does not wait for the longer one.
    """

    modules: tuple[wp.Module, wp.Module]
    pieces: KernelFunctions
    forward: wp.Kernel
    adjoint: wp.Kernel


@functools.cache
def candidate_kernels(code: Code) -> CandidateKernels:
    """Kernels for scenes of this code. Cheap: compilation happens at the first launch, or in warm-up."""
    pieces = make_pieces(code)
    forward_module, adjoint_module = module_of("forward", code), adjoint_module_of("adjoint", code, pieces)
    types = pieces.types
    Inputs, PhiGrain, PhiNode, Pose = types.Inputs, types.PhiGrain, types.PhiNode, types.Pose
    p2g, g2p, node = pieces.to_grid, pieces.to_particles, pieces.node
    p2g_adjoint, g2p_adjoint, node_adjoint = pieces.to_grid_adjoint, pieces.to_particles_adjoint, pieces.node_adjoint

    @wp.func
    def to_grid(k: Constants, a: Inputs, w: Place, read: int, write: int, h: wp.array4d[wp.vec4], grid: Grid):
        """Stress, P2G and the grid operation; the new F where it is not known yet."""
        for p in range(h.shape[3]):
            motion = load_motion(h, w.b, read, p)
            F = load_deformation(h, w.b, read, p)
            m = matter_of(k, p)
            F_next = p2g(k, a, m, w, p, position(motion), velocity(motion), affine(motion), F, grid)
            if read != write:
                store_deformation(h, w.b, write, p, F_next)
        for n in range(grid.count[w.listing] * BLOCK_NODES):
            node(k, a, w, active_node(n, w.listing, grid), grid)

    @wp.kernel(module=forward_module, enable_backward=False)
    def forward(
        k: Constants, a: Inputs, b: int, slot: int, start: wp.array4d[wp.vec4], h: wp.array4d[wp.vec4], grid: Grid
    ):
        _forget(slot, grid)
        for p in range(h.shape[3]):
            motion = load_motion(start, b, 0, p)
            store_motion(h, b, 0, p, position(motion), velocity(motion), affine(motion))
            store_deformation(h, b, 0, p, load_deformation(start, b, 0, p))
        rows = h.shape[1]
        for s in range(a.tool.shape[1] - 1):
            w = place_of(b, s, slot, slot, s + 1)
            read = s % rows
            write = (s + 1) % rows
            to_grid(k, a, w, read, write, h, grid)
            for p in range(h.shape[3]):
                x, v, C = g2p(k, a, w, load_position(h, b, read, p), grid)
                store_motion(h, b, write, p, x, v, C)
            for n in range(grid.count[slot] * BLOCK_NODES):
                clear(active_node(n, slot, grid), slot, w.stamp, grid)

    @wp.kernel(module=adjoint_module, enable_backward=False)
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
        _forget(slot, grid)
        grain_sum = PhiGrain()
        node_sum = PhiNode()
        steps = a.tool.shape[1] - 1
        for later in range(steps):
            s = steps - 1 - later
            w = place_of(b, s, slot, slot, later + 1)
            now_sum = Pose()
            then_sum = Pose()
            to_grid(k, a, w, s, s, h, grid)
            for p in range(h.shape[3]):
                bar = load_motion(bars, b, 0, p)
                x_bar, now_part, then_part = g2p_adjoint(
                    k, a, w, load_position(h, b, s, p), position(bar), velocity(bar), affine(bar), grid, grid_bars
                )
                store_motion(bars, b, 0, p, x_bar, wp.vec3(), wp.mat33())
                now_sum += now_part
                then_sum += then_part
            for n in range(grid.count[slot] * BLOCK_NODES):
                node_sum += node_adjoint(k, a, w, active_node(n, slot, grid), grid, grid_bars)
            for p in range(h.shape[3]):
                x_part = load_position(bars, b, 0, p)
                F_next_bar = load_deformation(bars, b, 0, p)
                x_bar, v_bar, C_bar, F_bar, phi_part, now_part, then_part = p2g_adjoint(
                    k, a, matter_of(k, p), w, p, h, x_part, F_next_bar, grid_bars
                )
                store_motion(bars, b, 0, p, x_bar, v_bar, C_bar)
                store_deformation(bars, b, 0, p, F_bar)
                grain_sum += phi_part
                now_sum += now_part
                then_sum += then_part
            tool_bar[b, s] = tool_bar[b, s] + now_sum
            tool_bar[b, s + 1] = tool_bar[b, s + 1] + then_sum
            for n in range(grid.count[slot] * BLOCK_NODES):
                clear_both(active_node(n, slot, grid), slot, w.stamp, grid, grid_bars)
        grain_bar[b, 0] = grain_sum
        node_bar[b, 0] = node_sum

    return CandidateKernels(modules=(forward_module, adjoint_module), pieces=pieces, forward=forward, adjoint=adjoint)


@wp.func
def _forget(slot: int, grid: Grid):
    """Reset a slot for the next candidate, with its own list and stamps."""
    for block in range(grid.listed.shape[1]):
        grid.listed[slot, block] = 0
        grid.felt[slot, block] = 0
    grid.count[slot] = 0
