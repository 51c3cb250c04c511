"""Rigid transforms as 4 x 4 matrices, stacked along leading axes."""

from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

Transforms: TypeAlias = Float[np.ndarray, "*stack 4 4"]
"""A stack of `T_a_b`."""
Vectors: TypeAlias = Float[np.ndarray, "*stack 3"]
"""A stack of points, or of rotation vectors [rad]."""


def inverse(T: Transforms) -> Transforms:
    """`T_b_a` of `T_a_b`."""
    turned = np.swapaxes(T[..., :3, :3], -1, -2)
    return transform(turned, -(turned @ T[..., :3, 3:])[..., 0])


def transform(rotation: Float[np.ndarray, "*stack 3 3"], origin: Vectors) -> Transforms:
    """Transform from a rotation matrix and the image of the origin."""
    T = np.zeros((*origin.shape[:-1], 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = rotation, origin, 1.0
    return T


def transform_points(T: Transforms, points: Float[np.ndarray, "*stack N 3"]) -> Float[np.ndarray, "*stack N 3"]:
    """The points in the other frame."""
    return points @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]


def log(rotation: Float[np.ndarray, "*stack 3 3"]) -> Vectors:
    """Rotation vectors [rad] of rotation matrices."""
    shape = rotation.shape[:-2]
    return Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec().reshape(*shape, 3)


def exp(vector: Vectors) -> Float[np.ndarray, "*stack 3 3"]:
    """Rotation matrices of rotation vectors [rad]."""
    return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*vector.shape[:-1], 3, 3)


def cross(vector: Vectors) -> Float[np.ndarray, "*stack 3 3"]:
    """`cross(a) @ b` is a x b."""
    matrix = np.zeros((*vector.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    return matrix - np.swapaxes(matrix, -1, -2)


def nearest_rotation(matrix: Float[np.ndarray, "*stack 3 3"]) -> Float[np.ndarray, "*stack 3 3"]:
    """The rotation that differs least from `matrix`, by the sum of squares (Kabsch 1976)."""
    left, _, right = np.linalg.svd(matrix)
    left[..., :, 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    return left @ right


def mean(T: Float[np.ndarray, "*stack V 4 4"]) -> Transforms:
    """The mean of V rotations, by chords, and of V origins."""
    return transform(nearest_rotation(T[..., :3, :3].mean(axis=-3)), T[..., :3, 3].mean(axis=-2))


def angle(rotation: Float[np.ndarray, "*stack 3 3"]) -> Float[np.ndarray, "*stack"]:
    """Angle of each rotation [rad]."""
    return np.asarray(np.linalg.norm(log(rotation), axis=-1))
