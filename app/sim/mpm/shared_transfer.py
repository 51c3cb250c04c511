"""Transfers between a particle and its 27 nodes by one thread, or by three of a GPU's warp with nine nodes each.

A GPU that has few particles waits for the next instruction of each of its few warps; three times as many wait less.
All three threads of a particle call these with the same arguments, and get the same sums.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportReturnType=false

from typing import NamedTuple

import warp as wp

from app.sim.effects.base import WarpFunction
from app.sim.mpm import touch_transfer, transfer
from app.sim.mpm.simd_intrinsics import three_threads
from app.sim.mpm.transfer import Mat34


class Transfers(NamedTuple):
    """Functions of `transfer` and `touch_transfer`, by one thread a particle or by three."""

    scatter: WarpFunction
    scatter_adjoint: WarpFunction
    gather: WarpFunction
    gather_adjoint: WarpFunction
    touch: WarpFunction
    touch_adjoint: WarpFunction


@wp.func_native(three_threads(transfer.SCATTER))
def scatter_plane(
    q: wp.vec3,
    momentum: wp.vec3,
    affine: wp.mat33,
    m: float,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    mass: wp.array2d[wp.vec4],
):
    """Share of a thread in `transfer.scatter`."""


@wp.func_native(three_threads(transfer.SCATTER_ADJOINT))
def scatter_adjoint_plane(
    q: wp.vec3,
    momentum: wp.vec3,
    affine: wp.mat33,
    m: float,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    node_bars: wp.array2d[wp.vec4],
) -> wp.mat44:
    """Share of a thread in `transfer.scatter_adjoint`; returns the whole."""


@wp.func_native(three_threads(transfer.GATHER))
def gather_plane(q: wp.vec3, blocks_y: int, blocks_z: int, slot: int, velocity: wp.array2d[wp.vec4]) -> Mat34:
    """Share of a thread in `transfer.gather`; returns the whole."""


@wp.func_native(three_threads(transfer.GATHER_ADJOINT))
def gather_adjoint_plane(
    q: wp.vec3,
    v_bar: wp.vec3,
    B_bar: wp.mat33,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    velocity: wp.array2d[wp.vec4],
    node_bars: wp.array2d[wp.vec4],
) -> wp.vec3:
    """Share of a thread in `transfer.gather_adjoint`; returns the whole."""


@wp.func_native(three_threads(touch_transfer.TOUCH))
def touch_plane(
    q: wp.vec3,
    given_touch: wp.vec4,
    given_aim: wp.vec4,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    touch: wp.array2d[wp.vec4],
    aim: wp.array2d[wp.vec4],
):
    """Share of a thread in `touch_transfer.scatter_touch`."""


@wp.func_native(three_threads(touch_transfer.TOUCH_ADJOINT))
def touch_adjoint_plane(
    q: wp.vec3,
    given_touch: wp.vec4,
    given_aim: wp.vec4,
    blocks_y: int,
    blocks_z: int,
    slot: int,
    touch_bars: wp.array2d[wp.vec4],
    aim_bars: wp.array2d[wp.vec4],
) -> Mat34:
    """Share of a thread in `touch_transfer.scatter_touch_adjoint`; returns the whole."""


WHOLE = Transfers(
    scatter=transfer.scatter,
    scatter_adjoint=transfer.scatter_adjoint,
    gather=transfer.gather,
    gather_adjoint=transfer.gather_adjoint,
    touch=touch_transfer.scatter_touch,
    touch_adjoint=touch_transfer.scatter_touch_adjoint,
)
BY_PLANES = Transfers(
    scatter=scatter_plane,
    scatter_adjoint=scatter_adjoint_plane,
    gather=gather_plane,
    gather_adjoint=gather_adjoint_plane,
    touch=touch_plane,
    touch_adjoint=touch_adjoint_plane,
)
