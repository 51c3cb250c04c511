"""Mapping of a bag's topics by their types, names and first messages."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from app.recording.exchange.ros2.bag import BagTopic
from app.recording.exchange.ros2.decode import is_depth_encoding
from app.recording.exchange.streams.stream_map import CameraStreams, CloudStream, StampSource, StreamMap, ToolStreams
from app.recording.exchange.streams.transform_tree import TransformTree

IMAGE: Final = "sensor_msgs/msg/Image"
COMPRESSED: Final = "sensor_msgs/msg/CompressedImage"
INFO: Final = "sensor_msgs/msg/CameraInfo"
CLOUD: Final = "sensor_msgs/msg/PointCloud2"
JOINTS: Final = "sensor_msgs/msg/JointState"
POSE: Final = "geometry_msgs/msg/PoseStamped"
TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"
TEXT: Final = "std_msgs/msg/String"
READ: Final = (IMAGE, COMPRESSED, INFO, CLOUD, JOINTS, POSE, TRANSFORMS, TEXT)
"""Types of messages that an import reads."""
_BASES: Final = ("base_link", "base", "robot_base", "world", "map", "base_footprint")
_BASE: Final = re.compile(r"(^|_)(base(_link)?|link_?0)$")
_TOOL: Final = re.compile(
    r"(^|_)(tcp|tip|tool0?|tool_frame|ee|ee_link|eef|end_effector(_link)?|hand|flange|gripper(_link|_tip|_center)?)($|_)"
)
_BEST_TOOLS: Final = ("tip", "tcp", "tool", "ee", "eef", "end_effector", "gripper", "hand", "flange")
_COMMAND: Final = re.compile(r"command|cmd|target|desired|goal|setpoint|reference", re.IGNORECASE)
_OTHER_POSE: Final = re.compile(r"initialpose|goal_pose|object|marker|tag|camera|odom", re.IGNORECASE)
_NO_COLOUR: Final = re.compile(r"infra|mask|label|debug|overlay|annotat|confidence|theora|thermal", re.IGNORECASE)
_OBJECT: Final = re.compile(r"object|rope|segment|cluster|filter", re.IGNORECASE)


def guess_map(
    topics: Mapping[str, BagTopic], firsts: Mapping[str, Any], tree: TransformTree, clock: StampSource
) -> StreamMap:
    """The likeliest mapping. `firsts`: the first message of each topic of a type in `READ`."""
    having = {name: topic for name, topic in topics.items() if topic.count and name in firsts}
    base = _base(tree, [it for it in having.values() if it.kind == POSE], firsts)
    cameras = _cameras(having, firsts)
    clouds = sorted(
        (name for name, it in having.items() if it.kind == CLOUD), key=lambda it: (not _names_object(it), it)
    )
    with_depth = any(camera.depth for camera in cameras)
    cloud = None if with_depth or not clouds else CloudStream(topic=clouds[0], select=not _names_object(clouds[0]))
    return StreamMap(
        clock=clock,
        base=base,
        tool=_tool(having, tree, base),
        cameras=cameras if with_depth or cloud is None else (),
        cloud=cloud,
    )


def _names_object(topic: str) -> bool:
    return _OBJECT.search(topic) is not None


def _base(tree: TransformTree, poses: Sequence[BagTopic], firsts: Mapping[str, Any]) -> str:
    """The arm's base: a frame called so, nearest to the root; else that of the poses, or the largest tree's root."""
    known = [name for name in _BASES if name in tree.frames]
    alike = sorted((name for name in tree.frames if _BASE.search(name)), key=lambda it: len(list(tree.parents(it))))
    told = [firsts[topic.name].header.frame_id for topic in poses if firsts[topic.name].header.frame_id]
    roots = sorted(tree.roots, key=lambda it: -tree.roots[it])
    return next(iter((*known, *alike, *told, *roots)), "")


def _tool(topics: Mapping[str, BagTopic], tree: TransformTree, base: str) -> ToolStreams:
    poses = sorted(name for name, it in topics.items() if it.kind == POSE and not _OTHER_POSE.search(name))
    commands = [name for name in poses if _COMMAND.search(name)]
    measured = [name for name in poses if name not in commands]
    measured.sort(key=lambda name: (_tool_rank(name.strip("/").replace("/", "_")), name))
    command = commands[0] if commands else ""
    frames = [frame for frame in tree.frames if _TOOL.search(frame) and tree.moves(frame, base)]
    frames.sort(key=lambda frame: (_tool_rank(frame), -len(list(tree.parents(frame))), frame))
    if measured:
        return ToolStreams(pose=measured[0], command=command)
    if frames:
        return ToolStreams(frame=frames[0], command=command)
    joints = next((name for name, it in sorted(topics.items()) if it.kind == JOINTS), "")
    described = next(
        (name for name, it in sorted(topics.items()) if it.kind == TEXT and name.endswith("robot_description")), ""
    )
    if joints and described:
        return ToolStreams(joints=joints, urdf=described, command=command)
    return ToolStreams(command=command)


def _tool_rank(name: str) -> int:
    """Place of the name among usual ones of a tool's tip."""
    return next((rank for rank, word in enumerate(_BEST_TOOLS) if word in name), len(_BEST_TOOLS))


def _cameras(topics: Mapping[str, BagTopic], firsts: Mapping[str, Any]) -> tuple[CameraStreams, ...]:
    images = [it for it in topics.values() if it.kind in (IMAGE, COMPRESSED)]
    depths = [it.name for it in images if _shows_depth(it, firsts[it.name])]
    colours = [it for it in images if it.name not in depths and not _NO_COLOUR.search(it.name)]
    infos = [name for name, it in topics.items() if it.kind == INFO]
    chosen = _one_a_source(colours)
    found = [_camera(name, depths, infos, firsts, alone=len(chosen) == 1) for name in chosen]
    # With any depth, views without it show less than they cost.
    kept = [it for it in found if it.depth] or found
    names = _short_names([it.color for it in kept])
    return tuple(
        CameraStreams(name=name, color=it.color, depth=it.depth, info=it.info, depth_info=it.depth_info)
        for name, it in zip(names, kept, strict=True)
    )


def _shows_depth(topic: BagTopic, first: Any) -> bool:
    encoding = first.encoding if topic.kind == IMAGE else first.format
    return is_depth_encoding(encoding) or topic.name.endswith("compressedDepth")


def _source(name: str) -> str:
    """The topic without its transport."""
    return re.sub(r"/(compressed|compressedDepth|ffmpeg|theora|zstd)$", "", name)


def _one_a_source(colours: Sequence[BagTopic]) -> list[str]:
    """One topic an image source: raw before compressed, rectified before distorted."""
    by_camera = dict[str, list[str]]()
    for topic in sorted(colours, key=lambda it: it.name):
        by_camera.setdefault(_source(topic.name).rpartition("/")[0], []).append(topic.name)
    return [min(names, key=lambda it: (it != _source(it), "rect" not in it, it)) for names in by_camera.values()]


def _camera(
    color: str, depths: Sequence[str], infos: Sequence[str], firsts: Mapping[str, Any], *, alone: bool
) -> CameraStreams:
    near = [(_shared(color, it), "aligned" in it or _frame(firsts, it) == _frame(firsts, color), it) for it in depths]
    beside = [it for it in near if it[0] > 0 or alone]
    depth = max(beside, key=lambda it: (it[0], it[1], it[2] == _source(it[2])))[2] if beside else ""
    info = _info_beside(color, infos)
    own = _info_beside(depth, infos) if depth else ""
    return CameraStreams(name="", color=color, depth=depth, info=info, depth_info=own if own != info else "")


def _frame(firsts: Mapping[str, Any], topic: str) -> str:
    return firsts[topic].header.frame_id


def _shared(a: str, b: str) -> int:
    """Number of leading parts of the names that are the same."""
    count = 0
    for one, other in zip(a.strip("/").split("/"), b.strip("/").split("/"), strict=False):
        if one != other:
            break
        count += 1
    return count


def _info_beside(image: str, infos: Sequence[str]) -> str:
    """The CameraInfo of an image topic: beside it, as image_transport has it, or else the nearest by name."""
    beside = f"{_source(image).rpartition('/')[0]}/camera_info"
    if beside in infos:
        return beside
    near = sorted(infos, key=lambda it: (-_shared(image, it), it))
    return near[0] if near and (_shared(image, near[0]) or len(infos) == 1) else ""


def _short_names(topics: Sequence[str]) -> list[str]:
    """Names of cameras: the first part of each topic that differs from the others' or else all but the last."""
    parts = [topic.strip("/").split("/") for topic in topics]
    for index in range(min(map(len, parts), default=0)):
        names = [part[index] for part in parts]
        if len(set(names)) == len(names) and not (len(names) == 1 and len(parts[0]) < 2):
            return names
    return [f"camera{index}" for index in range(len(topics))]
