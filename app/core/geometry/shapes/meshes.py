"""Triangle meshes of simple solids, for pictures. Who draws none does not load trimesh."""

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from app.core.geometry.shapes.base import Vector

if TYPE_CHECKING:
    import trimesh

_SECTIONS: Final = 48
_ARC: Final = 16


class TriangleMesh(NamedTuple):
    """Corners [m] and, of each triangle, the indices of its three, counter-clockwise from outside."""

    vertices: Float64[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]


def box_mesh(half_m: Vector, middle_m: Vector) -> TriangleMesh:
    """An upright box of these half sides about `middle_m`."""
    import trimesh

    return _mesh(trimesh.creation.box(extents=2 * np.asarray(half_m)), middle_m)


def rod_mesh(start_m: Vector, end_m: Vector, radius_m: float) -> TriangleMesh:
    """A cylinder about the line from `start_m` to `end_m`."""
    import trimesh

    return _mesh(trimesh.creation.cylinder(radius_m, segment=[start_m, end_m], sections=_SECTIONS))


def bowl_mesh(radius_m: float, thickness_m: float, centre_m: Vector = (0.0, 0.0, 0.0)) -> TriangleMesh:
    """Half of a hollow sphere about `centre_m`, open upwards; `radius_m`: the inner one."""
    import trimesh

    angles = np.linspace(-np.pi / 2, 0.0, _ARC)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    profile = np.concatenate([(radius_m + thickness_m) * arc, radius_m * arc[::-1]])
    return _mesh(trimesh.creation.revolve(profile, sections=_SECTIONS), centre_m)


def union_mesh(meshes: list[TriangleMesh]) -> TriangleMesh:
    """All of them as one."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + begin for mesh, begin in zip(meshes, first, strict=True)]),
    )


def _mesh(solid: "trimesh.Trimesh", at_m: Vector = (0.0, 0.0, 0.0)) -> TriangleMesh:
    return TriangleMesh(np.asarray(solid.vertices, np.float64) + at_m, np.asarray(solid.faces, np.int64))
