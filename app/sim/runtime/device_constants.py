"""Numerical constants of a scene: the structs that kernels read, on a device."""

# Warp's structs and vectors build their members at run time, which no static type describes.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false, reportGeneralTypeIssues=false

from collections.abc import Sequence

import numpy as np
import warp as wp

from app.sim.constants import BLOCK_SHIFT, Constants, Matter, Shape
from app.sim.model.scene import Scene
from app.sim.tools.base import Primitive

PIECE = 256
"""Blocks of 8 nodes of 16 bytes: 32 KiB."""


def blocks_of(scene: Scene) -> tuple[int, int, int]:
    """Number of blocks of nodes along x, y and z."""
    x, y, z = (-(-nodes // 2**shift) for nodes, shift in zip(scene.shape, BLOCK_SHIFT, strict=True))
    return x, y, z


def block_count_of(scene: Scene) -> int:
    """Number of blocks of one grid, rounded up: a GPU zeroes whole large pieces seven times faster than odd sizes."""
    x, y, z = blocks_of(scene)
    return -(-x * y * z // PIECE) * PIECE


def constants_of(scene: Scene, counts: Sequence[int], primitives: Sequence[Primitive], device: wp.Device) -> Constants:
    """The numbers of `scene` for bodies of these numbers of particles, on a device."""
    bodies = _bodies(scene, counts)
    k = Constants()
    k.origin = wp.vec3(*scene.low)
    k.nx, k.ny, k.nz = scene.shape
    _, k.blocks_y, k.blocks_z = blocks_of(scene)
    k.cell = scene.cell_m
    k.per_cell = 1.0 / scene.cell_m
    k.dt = scene.dt_s
    k.gravity = scene.gravity_m_s2
    k.decay = 1.0 - scene.damping_1_s * scene.dt_s
    k.least_mass = min(body.mass for body in bodies)
    k.contact_margin = scene.contact_margin_m
    k.contact_width = scene.contact_width_m
    k.contact_rate = 1.0 / (scene.contact_substeps * scene.dt_s)
    k.escape_speed = scene.escape_speed_m_s
    k.slip_speed = scene.slip_speed_m_s
    k.bodies = wp.array(bodies, dtype=Matter, device=device)
    k.shapes = wp.array([_shape(primitive) for primitive in primitives], dtype=Shape, device=device)
    return k


def _bodies(scene: Scene, counts: Sequence[int]) -> list[Matter]:
    bodies: list[Matter] = []
    first = np.cumsum([0, *counts])
    for number, (body, count, at) in enumerate(zip(scene.bodies, counts, first[:-1], strict=True)):
        m = Matter()
        m.number = number
        m.first = int(at)
        m.volume = body.volume_m3 / count
        m.mass = body.density_kg_m3 * m.volume
        m.mu_per_stiffness, m.lam_per_stiffness = body.material.lame()
        m.share = body.share
        m.viscosity = body.material.viscosity_pa_s
        m.own = wp.vec4(*body.material.own())
        bodies.append(m)
    return bodies


def _shape(primitive: Primitive) -> Shape:
    s = Shape()
    w, x, y, z = primitive.turn
    s.place, s.turn = wp.vec3(*primitive.place), wp.quat(x, y, z, w)
    s.size, s.friction = wp.vec4(*primitive.size), primitive.friction
    return s
