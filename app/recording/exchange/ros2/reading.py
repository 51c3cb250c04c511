"""Measured data that a mapping selects from a bag: poses in the base's frame, and images when they are looked at."""

from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.errors import RecordingError
from app.core.types import Cloud, Poses
from app.recording.exchange.npz_import import Poseline
from app.recording.exchange.ros2 import decode, guess
from app.recording.exchange.ros2.bag import NS, Bag
from app.recording.exchange.ros2.bag_camera import open_camera
from app.recording.exchange.ros2.message_times import APART_S, MessageTimes, decode_message
from app.recording.exchange.streams.measured_episode import MeasuredEpisode, SceneView
from app.recording.exchange.streams.rgbd import transform_points
from app.recording.exchange.streams.robot_description import RobotDescription
from app.recording.exchange.streams.stream_map import CloudStream, StampSource, StreamMap
from app.recording.exchange.streams.tool_line import MISSING_TOOL, line_of
from app.recording.exchange.streams.transform_tree import TransformTree, compose

Views: TypeAlias = tuple[Float64[np.ndarray, " V"], Callable[[float], SceneView]]
"""Moments [s], and what is seen at each."""
_NO_POINTS: Final[Cloud] = np.zeros((0, 3), np.float32)


def read_tree(bag: Bag, clock: StampSource, origin_ns: int) -> TransformTree:
    """All transforms of the bag, their times in seconds from `origin_ns`."""
    tree = TransformTree()
    topics = [it.name for it in bag.topics.values() if it.kind == guess.TRANSFORMS]
    for topic, received_ns, message in bag.messages(topics):
        for it in message.transforms:
            at_ns = _stamped_ns(it) if clock == "header" else received_ns
            frames = f"{topic}: {it.child_frame_id!r} in {it.header.frame_id!r}"
            pose = decode_message(bag, frames, lambda of: decode.pose_of(of.translation, of.rotation), it.transform)
            time_s = None if topic.endswith("static") else (at_ns - origin_ns) / NS
            tree.add(it.header.frame_id, it.child_frame_id, pose, time_s)
    return tree


def _stamped_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * NS + int(message.header.stamp.nanosec)


@final
class BagReading:
    """The episode of a bag; times are seconds from `origin_ns`. `firsts`: the first message of each topic."""

    def __init__(
        self, bag: Bag, streams: StreamMap, firsts: Mapping[str, Any], tree: TransformTree, origin_ns: int
    ) -> None:
        self._bag, self._streams, self._firsts, self._tree = bag, streams, firsts, tree
        self._origin_ns = origin_ns

    def episode(self) -> MeasuredEpisode:
        """The episode. Raises RecordingError where streams are missing or do not suffice."""
        tool = self._streams.tool
        state = self._state()
        command = self._pose_line(tool.command) if tool.command else None
        if state is None and command is None:
            raise self._problem(MISSING_TOOL)
        moments_s, look = self._views()
        return MeasuredEpisode(state=state, command=command, moments_s=moments_s, look=look, began_ns=self._origin_ns)

    def _state(self) -> Poseline | None:
        tool, base = self._streams.tool, self._streams.base
        if tool.pose:
            return self._pose_line(tool.pose)
        if tool.joints:
            return self._joint_line()
        if not tool.frame:
            return None
        times_s = self._tree.times_s(base, tool.frame)
        if not len(times_s):
            raise self._problem(f"the frame {tool.frame!r} never moves against {base!r}; name the tool's as tool.frame")
        return line_of(times_s, self._tree.poses(base, tool.frame, times_s), tool.tip_m)

    def _pose_line(self, topic: str) -> Poseline:
        """Poses of a topic of PoseStamped, in the base's frame."""
        times, poses, frames = list[float](), list[tuple[float, ...]](), set[str]()
        for _, received_ns, message in self._bag.messages([topic]):
            if not hasattr(message, "pose") or not hasattr(message, "header"):
                raise self._problem(f"{topic} is no stream of {guess.POSE}; name one as tool.pose")
            times.append(self._time_s(message, received_ns))
            pose = decode_message(
                self._bag, topic, lambda it: decode.pose_of(it.position, it.orientation), message.pose
            )
            poses.append(pose)
            frames.add(message.header.frame_id.lstrip("/"))
        if not times:
            raise self._problem(f"{topic} holds no message; name another as tool.pose, or a frame as tool.frame")
        if len(frames) > 1:
            raise self._problem(
                f"the poses of {topic} are in several frames, {', '.join(map(repr, sorted(frames)))}; one is read"
            )
        times_s, given = np.array(times), np.array(poses)
        return line_of(times_s, self._in_base(frames.pop(), times_s, given), self._streams.tool.tip_m)

    def _in_base(self, frame: str, times_s: Float64[np.ndarray, " T"], poses: Poses) -> Poses:
        if frame in ("", self._streams.base):
            return poses
        return compose(self._tree.poses(self._streams.base, frame, times_s), poses)

    def _joint_line(self) -> Poseline:
        tool = self._streams.tool
        times, rows = list[float](), list[dict[str, float]]()
        for _, received_ns, message in self._bag.messages([tool.joints]):
            times.append(self._time_s(message, received_ns))
            rows.append(decode.joint_positions(message))
        if not rows:
            raise self._problem(f"{tool.joints} holds no message; name a stream of poses as tool.pose")
        told = self._firsts.get(tool.urdf)
        robot = RobotDescription.read(tool.urdf, None if told is None else str(told.data))
        poses = robot.poses(self._streams.base, tool.frame, rows, tool.joint_unit)
        return line_of(np.array(times), poses, tool.tip_m)

    def _time_s(self, message: Any, received_ns: int) -> float:
        return ((_stamped_ns(message) if self._streams.clock == "header" else received_ns) - self._origin_ns) / NS

    def _views(self) -> Views:
        """Moments at which all cameras, or the clouds, show the scene, and how each is looked at."""
        if self._streams.cloud is not None:
            return self._cloud_views(self._streams.cloud)
        if not self._streams.cameras:
            raise self._problem(
                "nothing shows the object; name colour and depth images ([[camera]]) or point clouds ([cloud]) in the "
                "file of --topics, or record them"
            )
        topics = [name for it in self._streams.cameras for name in (it.color, it.depth) if name]
        times = {topic: self._times(topic) for topic in topics}
        cameras = [open_camera(it, times, self._firsts, self._tree, self._streams.base) for it in self._streams.cameras]
        moments_s = cameras[0].color.times_s
        for track in (track for it in cameras for track in it.tracks):
            there = track.is_near(moments_s)
            if not there.any():
                raise self._problem(
                    f"no image of {track.topic} is within {APART_S:g} s of one of {topics[0]}; leave one of them out, "
                    'or take the other clock (clock = "receive" or "header") in the file of --topics'
                )
            moments_s = moments_s[there]

        def look(time_s: float) -> SceneView:
            return SceneView(frames=tuple(it.frame(time_s) for it in cameras), points=_NO_POINTS)

        return moments_s, look

    def _cloud_views(self, cloud: CloudStream) -> Views:
        times = self._times(cloud.topic)
        frame = (cloud.frame or times.frame).lstrip("/")

        def look(time_s: float) -> SceneView:
            found = times.decode(time_s, decode.cloud_points)
            points = found.points
            if frame not in ("", self._streams.base):
                points = transform_points(points, self._tree.at(self._streams.base, frame, time_s))
            return SceneView(points=points, colours=found.colours, is_object=not cloud.select)

        return times.times_s, look

    def _times(self, topic: str) -> MessageTimes:
        return MessageTimes.read(self._bag, topic, self._streams.clock, self._origin_ns)

    def _problem(self, said: str) -> RecordingError:
        return RecordingError(f"{self._bag.path}: {said}.")
