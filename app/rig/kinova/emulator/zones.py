"""Protection zones: regions that the tool may not enter by a Cartesian motion."""

import numpy as np
from jaxtyping import Float64

from app.rig.kinova.api.codes import ShapeType
from app.rig.kinova.api.setup import Point, ProtectionZone, RotationMatrix, RotationMatrixRow, ZoneShape


def inside(zone: ProtectionZone, position: Float64[np.ndarray, "3"]) -> bool:
    """True for a point in an enabled zone, whose origin is its centre."""
    if not zone.is_enabled or (shape := zone.shape) is None:
        return False
    origin = shape.origin or Point()
    local = _rotation(shape) @ (position - np.array([origin.x, origin.y, origin.z]))
    sizes = np.array(shape.dimensions)
    match shape.shape_type:
        case ShapeType.SPHERE:
            return bool(np.linalg.norm(local) <= sizes[0])
        case ShapeType.CYLINDER:
            return bool(np.hypot(local[0], local[1]) <= sizes[0] and abs(local[2]) <= sizes[1] / 2)
        case ShapeType.RECTANGULAR_PRISM:
            return bool((np.abs(local) <= sizes / 2).all())
        case _:
            return False


def well_formed(zone: ProtectionZone) -> bool:
    """True where its shape has the number of dimensions of its kind, all above zero."""
    counts: dict[int, int] = {ShapeType.SPHERE: 1, ShapeType.CYLINDER: 2, ShapeType.RECTANGULAR_PRISM: 3}
    if zone.shape is None or zone.shape.shape_type not in counts:
        return False
    sizes = np.array(zone.shape.dimensions)
    return len(sizes) == counts[zone.shape.shape_type] and bool((np.isfinite(sizes) & (sizes > 0)).all())


def _rotation(shape: ZoneShape) -> Float64[np.ndarray, "3 3"]:
    """Rotation from the base's axes to the zone's; identity where none is given."""
    if shape.orientation is None:
        return np.eye(3)
    return _matrix(shape.orientation).T


def _matrix(said: RotationMatrix) -> Float64[np.ndarray, "3 3"]:
    rows = (each or RotationMatrixRow() for each in (said.row1, said.row2, said.row3))
    return np.array([[row.column1, row.column2, row.column3] for row in rows])
