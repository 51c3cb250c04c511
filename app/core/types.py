"""Shapes as types. Axis letters: B candidates, N particles, M cloud points, W waypoints, T samples in time."""

from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float, Float32, Float64, UInt8, UInt16

Cloud: TypeAlias = Float32[np.ndarray, "M 3"]
"""Surface points [m] in the world frame (that of the table, z up)."""
Points: TypeAlias = Float32[np.ndarray, "N 3"]
"""Particle positions [m] in the world frame."""
ColourImage: TypeAlias = UInt8[np.ndarray, "height width 3"]
"""RGB, 8 bits a channel."""
DepthImage: TypeAlias = UInt16[np.ndarray, "height width"]
"""Depth along the optical axis in the camera's depth unit; 0 means no reading."""
Intrinsics: TypeAlias = Float64[np.ndarray, "3 3"]
"""Pinhole matrix [pixel]."""
Transform: TypeAlias = Float64[np.ndarray, "4 4"]
"""`T_a_b` maps coordinates in frame b to frame a [m]."""
Path3: TypeAlias = Float64[np.ndarray, "W 3"]
"""Tool-tip positions [m] in the world frame."""
Poses: TypeAlias = Float64[np.ndarray, "T 7"]
"""x y z [m], quaternion w x y z; the tool tip in the world frame."""
ToolPose: TypeAlias = Float64[np.ndarray, "8"]
"""x y z [m], quaternion w x y z, opening [m] of the tool: how far its fingers are apart, 0 where it has none."""
OPENING: Final = 7
"""Place of the opening in a `ToolPose`, and in rows of a track that has it."""
Centreline: TypeAlias = Float32[np.ndarray, "2 n"]
"""x and y [m] of a rope's nodes in their order; n = 0 where unknown, and for other objects."""
ToolPath: TypeAlias = Float64[np.ndarray, "T 8"]
"""Poses of the tool in order."""
Vector: TypeAlias = Float[np.ndarray, " A"]
"""A flat vector of numbers; the owner documents units."""
