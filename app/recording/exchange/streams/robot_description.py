"""A robot's description (URDF) as forward kinematics: from joint positions to the pose of a link."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self, final
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.errors import RecordingError
from app.core.types import Poses
from app.recording.exchange.streams.stream_map import AngleUnit
from app.recording.exchange.streams.transform_tree import IDENTITY, compose, inverse

_TURNS: Final = ("revolute", "continuous")
_MOST_BYTES: Final = 16 << 20


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Joint:
    """A joint: its links, its origin in the parent, and its axis."""

    name: str
    kind: str
    parent: str
    origin: tuple[float, ...]
    axis: Float64[np.ndarray, "3"]
    mimic: tuple[str, float, float] | None

    def poses(self, positions: Float64[np.ndarray, " T"]) -> Poses:
        """Pose of the child in the parent at each position [rad or m]."""
        fixed = np.repeat(np.array([self.origin]), len(positions), axis=0)
        moved = np.repeat(np.array([IDENTITY]), len(positions), axis=0)
        if self.kind in _TURNS:
            moved[:, 3:] = Rotation.from_rotvec(positions[:, None] * self.axis).as_quat(scalar_first=True)
        elif self.kind == "prismatic":
            moved[:, :3] = positions[:, None] * self.axis
        return compose(fixed, moved)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RobotDescription:
    """The joints of a robot, by the link that each carries."""

    place: str
    joints: Mapping[str, _Joint]

    @classmethod
    def read(cls, place: str, text: str | None) -> Self:
        """The description `text`, or that in the file `place`. Raises RecordingError where it is none."""
        try:
            if text is None:
                text = Path(place).read_text(encoding="utf-8")
            if len(text) > _MOST_BYTES or "<!ENTITY" in text:
                raise ValueError("it is larger than 16 MB or defines entities")
            root = ElementTree.fromstring(text)  # noqa: S314, it defines no entities
            joints = {
                _attribute(it, "child", "link"): _joint(it) for it in root.iter("joint") if it.find("child") is not None
            }
        except (OSError, ValueError, TypeError, ElementTree.ParseError) as error:
            said = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise RecordingError(
                f"{place or 'tool.urdf'} is no description of a robot (URDF): {said}; name a file, or a topic that "
                "holds one, as tool.urdf in the file of --topics."
            ) from None
        return cls(place=place, joints=joints)

    def poses(self, base: str, link: str, rows: Sequence[Mapping[str, float]], unit: AngleUnit) -> Poses:
        """Pose of `link` in `base` at each row of joint positions. Raises RecordingError where it cannot be told."""
        link = link or self._last_link()
        up, down = self._chain(link), self._chain(base) if base in self._links else []
        of_link, of_base = (self._compose(chain, rows, unit) for chain in (up, down))
        return compose(inverse(of_base), of_link)

    @property
    def _links(self) -> frozenset[str]:
        return frozenset({*self.joints, *(joint.parent for joint in self.joints.values())})

    def _last_link(self) -> str:
        """The link farthest from the root."""
        return max(sorted(self.joints), key=lambda it: len(self._chain(it)), default="")

    def _chain(self, link: str) -> list[_Joint]:
        if link not in self._links:
            raise RecordingError(
                f"{self.place} has no link {link!r}; it has {', '.join(sorted(self._links)) or 'none'}. Name one as "
                "tool.frame in the file of --topics."
            )
        chain = list[_Joint]()
        while link in self.joints and len(chain) <= len(self.joints):
            chain.append(self.joints[link])
            link = self.joints[link].parent
        return chain

    def _compose(self, chain: Sequence[_Joint], rows: Sequence[Mapping[str, float]], unit: AngleUnit) -> Poses:
        pose = np.repeat(np.array([IDENTITY]), len(rows), axis=0)
        for joint in chain:
            pose = compose(joint.poses(self._positions(joint, rows, unit)), pose)
        return pose

    def _positions(
        self, joint: _Joint, rows: Sequence[Mapping[str, float]], unit: AngleUnit
    ) -> Float64[np.ndarray, " T"]:
        if joint.kind not in (*_TURNS, "prismatic"):
            return np.zeros(len(rows))
        name, factor, offset = joint.mimic or (joint.name, 1.0, 0.0)
        missing = next((index for index, row in enumerate(rows) if name not in row), None)
        if missing is not None:
            raise RecordingError(
                f"The joint positions say nothing of {name!r}, which moves the tool; they are of "
                f"{', '.join(rows[missing]) or 'no joint'}. Name another stream as tool.joints, or another tool.frame."
            )
        given = np.array([row[name] for row in rows])
        return factor * (np.radians(given) if unit == "deg" and joint.kind in _TURNS else given) + offset


def _attribute(element: ElementTree.Element, tag: str, attribute: str) -> str:
    found = element.find(tag)
    value = None if found is None else found.get(attribute)
    if value is None:
        raise ValueError(f"a joint has no {tag}")
    return value


def _joint(element: ElementTree.Element) -> _Joint:
    origin, axis, mimic = element.find("origin"), element.find("axis"), element.find("mimic")
    place = _three("0 0 0" if origin is None else origin.get("xyz", "0 0 0"))
    turn = Rotation.from_euler("xyz", _three("0 0 0" if origin is None else origin.get("rpy", "0 0 0")))
    along = _three("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    length = float(np.linalg.norm(along))
    copied = None
    if mimic is not None:
        copied = (mimic.get("joint", ""), float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0)))
    return _Joint(
        name=element.get("name", ""),
        kind=element.get("type", "fixed"),
        parent=_attribute(element, "parent", "link"),
        origin=(*place.tolist(), *turn.as_quat(scalar_first=True).tolist()),
        axis=along / (length or 1.0),
        mimic=copied,
    )


def _three(text: str) -> Float64[np.ndarray, "3"]:
    values = [float(part) for part in text.split()]
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise ValueError(f"{text!r} is not three numbers")
    return np.array(values)
