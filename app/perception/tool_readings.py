"""Readings of depth that may be of a tool: neither of the object nor between surfaces."""

import cv2
import numpy as np
from jaxtyping import Float64

from app.core.colours import Mask
from app.core.messages import Frame
from app.perception.cloud.depth import behind_an_edge, deproject
from app.perception.reconstruct import Reconstruction


def without_object(frame: Frame, how: Reconstruction) -> Mask:
    """Mask of the pixels that neither have the object's colour nor are beside such a one."""
    coloured = how.segmenting.masks(frame.color)[0].astype(np.uint8)
    return cv2.dilate(coloured, np.ones((3, 3), np.uint8)) == 0


def solid_points(frame: Frame, how: Reconstruction) -> Float64[np.ndarray, "M 3"]:
    """Points [m, world] without the object's, and without those between two surfaces."""
    wanted = without_object(frame, how) & ~behind_an_edge(frame.depth, how.edge_step_m, frame.camera)
    return deproject(frame.depth, wanted, frame.camera).astype(np.float64)
