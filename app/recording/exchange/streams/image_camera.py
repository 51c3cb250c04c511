"""A camera whose optics and place somebody gives by hand, as files of plain images know neither."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.messages import Frame
from app.core.types import ColourImage
from app.recording.exchange.streams.rgbd import Pinhole, RgbdPair, depth_steps
from app.recording.exchange.streams.stream_map import CameraStreams
from app.recording.exchange.streams.transform_tree import matrix


@final
@dataclass(frozen=True, kw_only=True)
class ImageCamera:
    """A camera with intrinsics and pose."""

    streams: CameraStreams

    def frame(
        self, time_s: float, color: ColourImage, depth_m: Float64[np.ndarray, "height width"] | None = None
    ) -> Frame:
        """The images as a frame; depth of another size covers the same view."""
        height, width = color.shape[:2]
        fx, fy, cx, cy = self.streams.intrinsics
        pair = RgbdPair(
            name=self.streams.name,
            time_s=time_s,
            color=color,
            optics=Pinhole(
                width=width,
                height=height,
                K=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
                distortion=self.streams.distortion,
            ),
            T_world_color=matrix(self.streams.pose),
        )
        if depth_m is None:
            return pair.frame()
        depth, unit_m = depth_steps(depth_m)
        if depth.shape == color.shape[:2]:
            return pair.with_depth(depth, unit_m).frame()
        optics = pair.optics.at_size(depth.shape[1], depth.shape[0])
        return pair.with_depth(depth, unit_m, optics, np.eye(4)).frame()
