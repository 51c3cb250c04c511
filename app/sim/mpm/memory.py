"""Memory of the kernels besides particles: the grid and its cotangents, as Warp structs of arrays.

States of particles and their cotangents are arrays of vec4 (B, R, QUADS, N); see `packed`. Axes: B candidates, R rows,
the states at the beginning of substep s in row s modulo R, N particles, G nodes, K blocks of nodes. A grid has one slot
for every candidate that is in work at the same time, or several where substeps overlap. Nodes lie block by block, so
that the 27 nodes around a particle lie in few places of the memory, and what is idle is skipped by blocks. A node's
vec4 is a momentum [kg m/s] and a mass [kg], or a velocity [m/s] and nothing, or a sum of touches or aims (see
`touching`).
"""

import warp as wp


@wp.struct
class Grid:
    """Nodes (slots, G), and lists of the blocks that matter: the first `count` of `active` (lists, K).

    A block comes onto its candidate's list when matter first comes near it, and stays for the whole action; `listed`
    says that it is there. `felt` (slots, K) is the substep's stamp where a tool touches particles of the block; stamps
    grow from one use of a slot to the next, so that they need not be cleared. `arrived` (lists,) counts arrivals where
    blocks of threads wait for each other (`action_kernels`).
    """

    mass: wp.array2d[wp.vec4]
    touch: wp.array2d[wp.vec4]
    aim: wp.array2d[wp.vec4]
    velocity: wp.array2d[wp.vec4]
    felt: wp.array2d[wp.int32]
    listed: wp.array2d[wp.int32]
    active: wp.array2d[wp.int32]
    count: wp.array[wp.int32]
    arrived: wp.array[wp.int32]


@wp.struct
class GridBars:
    """Cotangents of the nodes: first of their velocities, then of momentum and mass; and those of their touches."""

    node: wp.array2d[wp.vec4]
    touch: wp.array2d[wp.vec4]
    aim: wp.array2d[wp.vec4]
