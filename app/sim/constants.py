"""The scene as the kernels see it: one Warp struct."""

# Warp's structs and vectors build their members at run time, which no static type describes.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false, reportGeneralTypeIssues=false

import warp as wp

from app.sim.scene import Scene


@wp.struct
class Constants:
    """SI units. `origin` is the position of the node (0, 0, 0)."""

    origin: wp.vec3
    nx: wp.int32
    ny: wp.int32
    nz: wp.int32
    cell: wp.float32
    per_cell: wp.float32
    dt: wp.float32
    gravity: wp.float32
    decay: wp.float32
    mass: wp.float32
    volume: wp.float32
    mu_per_stiffness: wp.float32
    lam_per_stiffness: wp.float32
    finger_radius: wp.float32
    contact_margin: wp.float32
    contact_width: wp.float32
    contact_rate: wp.float32
    escape_speed: wp.float32
    slip_speed: wp.float32


def constants_of(scene: Scene, particle_count: int) -> Constants:
    """The numbers of `scene` for an object of `particle_count` equal particles."""
    k = Constants()
    k.origin = wp.vec3(*scene.low)
    k.nx, k.ny, k.nz = scene.shape
    k.cell = scene.cell_m
    k.per_cell = 1.0 / scene.cell_m
    k.dt = scene.dt_s
    k.gravity = scene.gravity_m_s2
    k.decay = 1.0 - scene.damping_1_s * scene.dt_s
    k.volume = scene.object_volume_m3 / particle_count
    k.mass = scene.density_kg_m3 * k.volume
    k.mu_per_stiffness = 0.5 / (1.0 + scene.poisson)
    k.lam_per_stiffness = scene.poisson / ((1.0 + scene.poisson) * (1.0 - 2.0 * scene.poisson))
    k.finger_radius = scene.finger_radius_m
    k.contact_margin = scene.contact_margin_m
    k.contact_width = scene.contact_width_m
    k.contact_rate = 1.0 / (scene.contact_substeps * scene.dt_s)
    k.escape_speed = scene.escape_speed_m_s
    k.slip_speed = scene.slip_speed_m_s
    return k
