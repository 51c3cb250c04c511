"""Memory layout of the grid's nodes, and the blocks of them that are active."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false

import warp as wp

from app.sim.constants import BLOCK_NODES, BLOCK_SHIFT, Constants
from app.sim.mpm.simd_intrinsics import NEARBY

SIDE_X, SIDE_Y, SIDE_Z = (wp.constant(2**shift) for shift in BLOCK_SHIFT)


@wp.func
def inside(k: Constants, x: wp.vec3) -> bool:
    """True if all 27 nodes around `x` exist; False for NaN."""
    q = cells(k, x)
    return (
        q[0] >= 0.5
        and q[1] >= 0.5
        and q[2] >= 0.5
        and q[0] < float(k.nx) - 1.5
        and q[1] < float(k.ny) - 1.5
        and q[2] < float(k.nz) - 1.5
    )


@wp.func
def cells(k: Constants, x: wp.vec3) -> wp.vec3:
    """A position in cells from the node (0, 0, 0)."""
    return (x - k.origin) * k.per_cell


@wp.func
def node_position(k: Constants, node: int) -> wp.vec3:
    """Position [m] of a node, given its index in memory."""
    block = node // BLOCK_NODES
    i = SIDE_X * (block // (k.blocks_y * k.blocks_z)) + (node // (SIDE_Y * SIDE_Z)) % SIDE_X
    j = SIDE_Y * ((block // k.blocks_z) % k.blocks_y) + (node // SIDE_Z) % SIDE_Y
    n = SIDE_Z * (block % k.blocks_z) + node % SIDE_Z
    return k.origin + k.cell * wp.vec3(float(i), float(j), float(n))


@wp.func_native(
    NEARBY
    + """
    int* known = listed.data + (long long)listing * listed.shape[1];
    int* members = active.data + (long long)listing * active.shape[1];
    int seen[8];
    #pragma unroll
    for (int n = 0; n < 8; n++)
        seen[n] = own[n] ? known[blocks[n]] : 1;
    #pragma unroll
    for (int n = 0; n < 8; n++) {
        if (seen[n] == 0) {
        #if defined(__CUDA_ARCH__)
            if (atomicExch(known + blocks[n], 1) == 0)
                members[atomicAdd(count.data + listing, 1)] = blocks[n];
        #else
            known[blocks[n]] = 1;
            members[count.data[listing]++] = blocks[n];
        #endif
        }
    }
"""
)
def enlist(
    q: wp.vec3,
    blocks_y: int,
    blocks_z: int,
    listing: int,
    listed: wp.array2d[wp.int32],
    active: wp.array2d[wp.int32],
    count: wp.array[wp.int32],
):
    """Put the blocks around a particle on a list of active ones, where they stay for the whole action."""


@wp.func_native(
    NEARBY
    + """
    int* stamps = felt.data + (long long)slot * felt.shape[1];
    #pragma unroll
    for (int n = 0; n < 8; n++)
        stamps[blocks[n]] = stamp;
"""
)
def enlist_felt(q: wp.vec3, blocks_y: int, blocks_z: int, slot: int, stamp: int, felt: wp.array2d[wp.int32]):
    """Flag the blocks around a particle that a tool touches."""
