"""A camera of a bag: its topics, its optics, and where it is."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from app.core.errors import RecordingError
from app.core.messages import Frame
from app.core.types import Transform
from app.recording.exchange.ros2 import decode
from app.recording.exchange.ros2.message_times import MessageTimes, decode_message
from app.recording.exchange.streams.rgbd import MM_M, Pinhole, RgbdPair
from app.recording.exchange.streams.stream_map import CameraStreams
from app.recording.exchange.streams.transform_tree import TransformTree, matrix


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BagCamera:
    """A camera; `depth_optics` of depth that is not aligned to colour, else None."""

    streams: CameraStreams
    base: str
    tree: TransformTree
    color: MessageTimes
    depth: MessageTimes | None
    optics: Pinhole
    depth_optics: Pinhole | None

    @property
    def tracks(self) -> tuple[MessageTimes, ...]:
        """Its topics of images."""
        return (self.color, self.depth) if self.depth else (self.color,)

    def frame(self, time_s: float) -> Frame:
        """The images nearest to a time. Raises RecordingError where an encoding or a transform is missing."""
        color = self.color.decode(time_s, decode.colour_image)
        pair = RgbdPair(
            name=self.streams.name,
            time_s=time_s,
            color=color,
            optics=self.optics.at_size(color.shape[1], color.shape[0]),
            T_world_color=self._pose(time_s),
        )
        if self.depth is None:
            return pair.frame()
        unit_m = self.streams.depth_unit_m or MM_M
        depth, unit_m = self.depth.decode(time_s, lambda it: decode.depth_image(it, unit_m))
        size = depth.shape[1], depth.shape[0]
        if self.depth_optics is not None:
            aside = self.tree.at(self._frame, self.depth.frame, time_s)
            return pair.with_depth(depth, unit_m, self.depth_optics.at_size(*size), aside).frame()
        if depth.shape != color.shape[:2]:
            return pair.with_depth(depth, unit_m, pair.optics.at_size(*size), np.eye(4)).frame()
        return pair.with_depth(depth, unit_m).frame()

    @property
    def _frame(self) -> str:
        return (self.streams.frame or self.color.frame).lstrip("/")

    def _pose(self, time_s: float) -> Transform:
        if self.streams.pose:
            return matrix(self.streams.pose)
        try:
            return self.tree.at(self.base, self._frame, time_s)
        except RecordingError as error:
            raise RecordingError(
                f"{self.color.bag.path}: nothing says where camera {self.streams.name!r} is. {error} A pose is given "
                "as pose = [x, y, z, qw, qx, qy, qz] below [[camera]]."
            ) from None


def open_camera(
    streams: CameraStreams,
    times: Mapping[str, MessageTimes],
    firsts: Mapping[str, Any],
    tree: TransformTree,
    base: str,
) -> BagCamera:
    """The camera of these topics. Raises RecordingError where its optics are unknown."""
    color, depth = times[streams.color], times.get(streams.depth)
    aside = depth is not None and depth.frame != color.frame and "aligned" not in depth.topic
    if depth is not None and aside and not streams.depth_info:
        raise RecordingError(
            f"{color.bag.path}: {depth.topic} is in the frame {depth.frame!r} and {color.topic} in {color.frame!r}, "
            "and no CameraInfo tells how the depth camera sees; name it as depth_info below [[camera]], or record "
            "depth that is aligned to colour."
        )
    depth_optics = None
    if depth is not None and aside:
        depth_optics = _optics_of(streams.depth_info, "rect" in depth.topic, depth, firsts)
    return BagCamera(
        streams=streams,
        base=base,
        tree=tree,
        color=color,
        depth=depth,
        optics=_color_optics(streams, color, firsts),
        depth_optics=depth_optics,
    )


def _color_optics(streams: CameraStreams, color: MessageTimes, firsts: Mapping[str, Any]) -> Pinhole:
    if not streams.intrinsics:
        return _optics_of(streams.info, "rect" in streams.color, color, firsts)
    height, width = color.decode(float(color.times_s[0]), decode.colour_image).shape[:2]
    fx, fy, cx, cy = streams.intrinsics
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Pinhole(width=width, height=height, K=K, distortion=streams.distortion)


def _optics_of(info: str, rectified: bool, images: MessageTimes, firsts: Mapping[str, Any]) -> Pinhole:
    if info not in firsts:
        raise RecordingError(
            f"{images.bag.path}: no CameraInfo tells how {images.topic} sees; name one as info below [[camera]], or "
            "give intrinsics = [fx, fy, cx, cy] in pixels there."
        )
    return decode_message(images.bag, info, lambda it: decode.pinhole(it, rectified=rectified), firsts[info])
