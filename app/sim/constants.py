"""A scene as the kernels see it: Warp structs."""

# Warp's structs and vectors build their members at run time, which no static type describes.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false, reportGeneralTypeIssues=false
# pyright: reportInvalidTypeForm=false

import warp as wp

BLOCK_SHIFT = (1, 1, 1)
BLOCK_NODES = wp.constant(2 ** sum(BLOCK_SHIFT))
"""Nodes lie in memory in blocks of 2^shift along each axis. Measured on an H200 with 150 ropes of 300 particles: blocks
of 4 x 4 x 4 hold 2.2 times as many idle nodes, and an action with its adjoint takes 8 % longer."""


@wp.struct
class Matter:
    """Body `number`: its particles are `first` to before the next body's; each has this mass [kg] and volume [m^3].

    Its stiffness is `share` of phi's, its Lame parameters are these per unit of it; `own` is as its law reads it.
    """

    number: wp.int32
    first: wp.int32
    mass: wp.float32
    volume: wp.float32
    mu_per_stiffness: wp.float32
    lam_per_stiffness: wp.float32
    share: wp.float32
    viscosity: wp.float32
    own: wp.vec4


@wp.struct
class Shape:
    """One primitive of a tool: where it is at rest, its sizes [m] and its Coulomb friction coefficient."""

    place: wp.vec3
    turn: wp.quat
    size: wp.vec4
    friction: wp.float32


@wp.struct
class Constants:
    """SI units. `origin` is the position of the node (0, 0, 0)."""

    origin: wp.vec3
    nx: wp.int32
    ny: wp.int32
    nz: wp.int32
    blocks_y: wp.int32
    blocks_z: wp.int32
    cell: wp.float32
    per_cell: wp.float32
    dt: wp.float32
    gravity: wp.float32
    decay: wp.float32
    least_mass: wp.float32
    contact_margin: wp.float32
    contact_width: wp.float32
    contact_rate: wp.float32
    escape_speed: wp.float32
    slip_speed: wp.float32
    bodies: wp.array[Matter]
    shapes: wp.array[Shape]
