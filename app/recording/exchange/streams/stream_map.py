"""Mapping of the streams of a file to what an import needs: guessed, shown as TOML, edited, and read again."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, TypeAlias, cast, final, get_args

import tomli_w

from app.core.colours import ColourRange
from app.core.errors import ParameterError, RecordingError
from app.core.geometry.hand_eye import Three
from app.recording.exchange.plain_checks import plausible_about
from app.recording.exchange.toml_file import finite_number, read_toml, refuse_unknown, words

StampSource: TypeAlias = Literal["header", "receive"]
"""Clock of the messages: the stamps in their headers, or the times at which they were received."""
AngleUnit: TypeAlias = Literal["rad", "deg"]


@final
@dataclass(frozen=True, kw_only=True)
class CameraStreams:
    """Streams of one camera. Its optical frame is x right, y down, z forward.

    `pose`: x y z [m] and quaternion w x y z in the frame of the base, in place of a transform of `frame`.
    `intrinsics`: fx, fy, cx, cy [pixel], in place of what `info` says; `distortion`: k1, k2, p1, p2, k3 of the colour
    image. `depth_unit_m`: 0 where the file says it.
    """

    name: str
    color: str
    depth: str = ""
    info: str = ""
    depth_info: str = ""
    frame: str = ""
    pose: tuple[float, ...] = ()
    intrinsics: tuple[float, ...] = ()
    distortion: tuple[float, ...] = ()
    depth_unit_m: float = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class CloudStream:
    """A stream of point clouds. `select`: leave to the object's colour and place which points are the object's."""

    topic: str
    frame: str = ""
    select: bool = True


@final
@dataclass(frozen=True, kw_only=True)
class ToolStreams:
    """Streams of the tool's poses: as measured a stream of poses, or else the transform of a frame; as commanded.

    `tip_m`: place of the tool's tip in that frame. `components`: names of the numbers of a pose, for streams of plain
    numbers. `joints`, `urdf`: stream of joint positions, and the robot's description (a file, or a stream that holds
    it) that places `frame` by them. `command_ahead_s`: time from that of a command to that for which it is meant.
    """

    pose: str = ""
    frame: str = ""
    command: str = ""
    tip_m: Three = (0.0, 0.0, 0.0)
    components: tuple[str, ...] = ()
    joints: str = ""
    urdf: str = ""
    joint_unit: AngleUnit = "rad"
    command_ahead_s: float = 0.0


@final
@dataclass(frozen=True, kw_only=True)
class ObjectRegion:
    """Appearance and place of the object, where they are not the task's.

    `colour`: bounds of hue [degree], saturation and value; `low_m`, `high_m`: the corners of the box that it is in.
    """

    colour: ColourRange | None = None
    low_m: Three | None = None
    high_m: Three | None = None
    table_m: float | None = None


@final
@dataclass(frozen=True, kw_only=True)
class StreamMap:
    """The whole mapping. `base`: frame of the arm's base; `pushes`: first and last second of each, by hand.

    `about`: what is known of task, tool and object, as in the plain import format.
    """

    clock: StampSource = "header"
    base: str = ""
    pushes: tuple[tuple[float, float], ...] = ()
    tool: ToolStreams = ToolStreams()
    object: ObjectRegion = ObjectRegion()
    cameras: tuple[CameraStreams, ...] = ()
    cloud: CloudStream | None = None
    about: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType(dict[str, Any]()))

    @property
    def names(self) -> frozenset[str]:
        """Names of all streams in it."""
        camera = [name for it in self.cameras for name in (it.color, it.depth, it.info, it.depth_info)]
        tool = (self.tool.pose, self.tool.command, self.tool.joints)
        return frozenset({*camera, *tool, self.cloud.topic if self.cloud else ""} - {""})

    def toml(self) -> str:
        """The mapping as a TOML document, which `read_stream_map` reads."""
        plain = {
            "clock": self.clock,
            "base": self.base,
            "pushes": [list(each) for each in self.pushes],
            "about": dict(self.about),
            "tool": _without_defaults(self.tool, ToolStreams(), keep=("pose", "frame", "command", "tip_m")),
            "object": _region(self.object),
            "cloud": _without_defaults(self.cloud, CloudStream(topic="")) if self.cloud else None,
        }
        cameras = [_without_defaults(it, CameraStreams(name="", color="")) for it in self.cameras]
        parts = [tomli_w.dumps({key: value for key, value in plain.items() if value not in (None, {}, [])})]
        text = "\n[[camera]]\n".join([*parts, *map(tomli_w.dumps, cameras)])
        return _LIST.sub(lambda found: f"[{' '.join(found[1].split()).rstrip(',')}]", text)

    def require(self, known: Sequence[str], path: Path) -> None:
        """Raises RecordingError where it names a stream that is not in the file at `path`."""
        for name in sorted(self.names):
            if name not in known:
                raise RecordingError(
                    f"{path} holds no {name!r}; it holds {', '.join(known) or 'nothing'}. Name one of them in the file "
                    "of --topics; --show prints such a file."
                )


def _without_defaults(given: Any, default: Any, keep: tuple[str, ...] = ()) -> dict[str, Any]:
    """Fields that differ from the default, and those to `keep`."""
    names = [name for name in vars(default) if name in keep or getattr(given, name) != getattr(default, name)]
    values = {name: getattr(given, name) for name in names}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def _region(region: ObjectRegion) -> dict[str, Any]:
    table = _without_defaults(replace(region, colour=None), ObjectRegion())
    if region.colour is not None:
        table |= {name: list(getattr(region.colour, name)) for name in _COLOUR}
    return table


_LIST: Final = re.compile(r"\[\n((?: +[^\n\[\]]+,\n)+) *\]")
"""A list of plain values over several lines."""
_COLOUR: Final = ("hue_deg", "saturation", "value")
_ANY: Final[dict[str, tuple[float, float]]] = {
    "hue_deg": (0.0, 360.0),
    "saturation": (0.35, 1.0),
    "value": (0.12, 1.0),
}


def read_stream_map(path: Path) -> StreamMap:
    """The mapping in the file. Raises RecordingError, which names the key, where it is not one."""
    try:
        return _parse(read_toml(path))
    except OSError as error:
        raise RecordingError(
            f"Cannot read the mapping {path}: {error.strerror}; --show prints one that can be edited."
        ) from None
    except (ValueError, ParameterError, RecordingError) as error:
        raise RecordingError(f"{path} is no mapping of topics: {str(error).rstrip('.')}.") from None


def _parse(table: Mapping[str, Any]) -> StreamMap:
    known = ("clock", "base", "pushes", "about", "tool", "object", "cloud", "camera")
    refuse_unknown("", table, known)
    cameras = table.get("camera", [])
    if not isinstance(cameras, list) or not all(isinstance(it, dict) for it in cast(list[Any], cameras)):
        raise ValueError("each camera must be a table of its own: write [[camera]]")
    cloud = _table("cloud", table)
    about = _about(_table("about", table))
    read = StreamMap(
        clock=_choice("clock", table.get("clock", "header"), get_args(StampSource)),
        base=_text("base", table),
        pushes=_pushes(table.get("pushes", [])),
        tool=_tool(_table("tool", table)),
        object=_object(_table("object", table)),
        cloud=_cloud(cloud) if cloud else None,
        cameras=tuple(_camera(it, number) for number, it in enumerate(cast(list[dict[str, Any]], cameras))),
        about=MappingProxyType(about),
    )
    names = [camera.name for camera in read.cameras]
    if len(set(names)) < len(names):
        raise ValueError(f"two cameras have the same name, {', '.join(names)}; give each its own")
    return read


def _table(name: str, table: Mapping[str, Any]) -> Mapping[str, Any]:
    value: Any = table.get(name, {})
    if not isinstance(value, dict):
        raise ValueError(f"{name} = {value!r} is no table; write [{name}] and its keys below")
    return cast(Mapping[str, Any], value)


def _about(table: Mapping[str, Any]) -> dict[str, Any]:
    try:
        json.dumps(table)
    except TypeError:
        raise ValueError("about holds a date or a time; write strings, numbers, lists and tables") from None
    plausible_about(table)
    return dict(table)


def _text(name: str, table: Mapping[str, Any], place: str = "") -> str:
    value: Any = table.get(name, "")
    if not isinstance(value, str):
        raise ValueError(f"{place}{name} = {value!r} is no string; put it in quotes")
    return value


def _choice(name: str, value: object, known: tuple[Any, ...]) -> Any:
    if value not in known:
        raise ValueError(f"{name} = {value!r} is not known; known are {', '.join(map(str, known))}")
    return value


def _numbers(name: str, value: object, count: int) -> tuple[float, ...]:
    if not isinstance(value, list) or len(cast(list[Any], value)) != count:
        raise ValueError(f"{name} = {value!r} must be {count} numbers")
    return tuple(finite_number(f"{name}[{index}]", each) for index, each in enumerate(cast(list[Any], value)))


def _three(name: str, value: object) -> Three:
    x, y, z = _numbers(name, value, 3)
    return x, y, z


def _pushes(value: object) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list):
        raise ValueError(f"pushes = {value!r} must be a list of [first, last] in seconds")
    found = [_numbers(f"pushes[{index}]", each, 2) for index, each in enumerate(cast(list[Any], value))]
    for index, (first, last) in enumerate(found):
        if not first < last:
            raise ValueError(f"pushes[{index}] ends at {last:g} s before it begins at {first:g} s")
        if index and first < found[index - 1][1]:
            raise ValueError(f"pushes[{index}] begins before the end of the one before; give them in order")
    return tuple((first, last) for first, last in found)


def _tool(table: Mapping[str, Any]) -> ToolStreams:
    refuse_unknown("tool.", table, vars(ToolStreams()))
    return ToolStreams(
        **{name: _text(name, table, "tool.") for name in ("pose", "frame", "command", "joints", "urdf")},
        tip_m=_three("tool.tip_m", table.get("tip_m", [0.0, 0.0, 0.0])),
        components=words("tool.components", table.get("components", [])),
        command_ahead_s=finite_number("tool.command_ahead_s", table.get("command_ahead_s", 0.0)),
        joint_unit=_choice("tool.joint_unit", table.get("joint_unit", "rad"), get_args(AngleUnit)),
    )


def _object(table: Mapping[str, Any]) -> ObjectRegion:
    refuse_unknown("object.", table, (*_COLOUR, "low_m", "high_m", "table_m"))
    colour = None
    if any(name in table for name in _COLOUR):
        hue, saturation, value = (_numbers(f"object.{name}", table.get(name, list(_ANY[name])), 2) for name in _COLOUR)
        colour = ColourRange.of((hue[0], hue[1]), (saturation[0], saturation[1]), (value[0], value[1]))
    low, high = (_three(f"object.{name}", table[name]) if name in table else None for name in ("low_m", "high_m"))
    if low and high and any(a >= b for a, b in zip(low, high, strict=True)):
        raise ValueError(f"object.low_m = {list(low)} must be below object.high_m = {list(high)}")
    height = finite_number("object.table_m", table["table_m"]) if "table_m" in table else None
    return ObjectRegion(colour=colour, low_m=low, high_m=high, table_m=height)


def _cloud(table: Mapping[str, Any]) -> CloudStream:
    refuse_unknown("cloud.", table, vars(CloudStream(topic="")))
    select: Any = table.get("select", True)
    if not isinstance(select, bool):
        raise ValueError(f"cloud.select = {select!r} must be true or false")
    return CloudStream(topic=_text("topic", table, "cloud."), frame=_text("frame", table, "cloud."), select=select)


def _camera(table: Mapping[str, Any], number: int) -> CameraStreams:
    place = f"camera {number}: "
    refuse_unknown(place, table, vars(CameraStreams(name="", color="")))
    texts = {name: _text(name, table, place) for name in ("name", "color", "depth", "info", "depth_info", "frame")}
    if not texts["color"]:
        raise ValueError(f"{place}color names no stream of colour images")
    pose = _numbers(f"{place}pose", table["pose"], 7) if "pose" in table else ()
    if pose and abs(sum(part**2 for part in pose[3:]) - 1) > _UNIT:
        raise ValueError(f"{place}pose is x, y, z [m] and a quaternion w, x, y, z of length 1")
    intrinsics = _numbers(f"{place}intrinsics", table["intrinsics"], 4) if "intrinsics" in table else ()
    if intrinsics and min(intrinsics[:2]) <= 0:
        raise ValueError(f"{place}intrinsics are fx, fy, cx, cy in pixels, and fx and fy above 0")
    unit = finite_number(f"{place}depth_unit_m", table.get("depth_unit_m", 0.0))
    if not 0 <= unit < 1:
        raise ValueError(f"{place}depth_unit_m = {unit:g} must be metres a step, for example 0.001")
    return CameraStreams(
        **{**texts, "name": texts["name"] or f"camera{number}"},
        pose=pose,
        intrinsics=intrinsics,
        distortion=_numbers(f"{place}distortion", table["distortion"], 5) if "distortion" in table else (),
        depth_unit_m=unit,
    )


_UNIT: Final = 0.02
"""Tolerance of a quaternion's squared length about 1: two digits were written."""
