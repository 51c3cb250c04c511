"""Messages of every kind, made from their annotations, so that a new kind is tested without being named here."""

import dataclasses
import itertools
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import anyio
import numpy as np
from jaxtyping import AbstractArray
from scipy.spatial.transform import Rotation

from app.core.dialogue.approval import ApprovalGate, Approved
from app.core.messages import Decision, Episode, Frame, Message, Particles, Proposal, fresh_id
from app.recording.format.records import ApprovalRecord
from app.recording.write.preflight import Room
from app.recording.write.writer import open_recording

AXES = {
    "N": 37,
    "M": 53,
    "L": 29,
    "P": 37,
    "W": 5,
    "Q": 5,
    "G": 5,
    "T": 11,
    "D": 2,
    "A": 4,
    "F": 3,
    "K": 7,
    "_": 24,
    "height": 480,
    "width": 640,
}


def all_kinds() -> list[type[Message]]:
    """Every message type of the vocabulary that can be made."""
    import app.core.messages as vocabulary

    kinds, waiting = set[type[Message]](), [vocabulary.Message]
    while waiting:
        subclasses = waiting.pop().__subclasses__()
        waiting.extend(subclasses)
        kinds.update(kind for kind in subclasses if kind.__module__.startswith("app.core"))
    return sorted(kinds, key=lambda kind: kind.__name__)


class Maker:
    """Maker of values of annotated types: `make(kind, **fields)`; the fields given stand as they are."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.count = itertools.count(1)
        self.shown: list[tuple[Proposal, Decision]] = []

    def __call__(self, kind: Any, **given: Any) -> Any:
        if kind is Approved:
            return self.approved()
        if dataclasses.is_dataclass(kind):
            hints = get_type_hints(kind)
            names = [field.name for field in dataclasses.fields(kind) if field.name not in given]
            values = {name: self.field(kind, name, hints[name]) for name in names}
            return kind(**values, **given)
        if isinstance(kind, type) and issubclass(kind, AbstractArray):
            return self.array(kind)
        origin = get_origin(kind)
        if origin is Literal:
            return get_args(kind)[int(self.rng.integers(len(get_args(kind))))]
        if origin is tuple:
            items = get_args(kind)
            if items == (float, float):
                return tuple(sorted(self.rng.uniform(size=2).tolist()))  # Bounds of something between 0 and 1.
            return tuple(map(self, items if Ellipsis not in items else items[:1] * 3))
        if isinstance(origin, type) and issubclass(origin, Mapping):
            return types.MappingProxyType({f"ключ {n}": self(get_args(kind)[1]) for n in range(2)})
        plain = {float: lambda: float(self.rng.normal()), int: lambda: int(self.rng.integers(1, 3)), bool: lambda: True}
        return plain[kind]() if kind in plain else f'text {next(self.count)} \N{GREEK SMALL LETTER MU} "quoted"\n'

    def field(self, kind: Any, name: str, annotation: Any) -> Any:
        match name:
            case "id":
                return fresh_id(kind.__name__.lower())
            case "time_s":
                return 1000.0 + next(self.count) * 0.1
            case "width" | "height":
                return AXES[name]
            case "name":
                return f"name{next(self.count)}"
            case "T_world_camera":
                T = np.eye(4)
                T[:3, :3] = Rotation.random(rng=self.rng).as_matrix()
                T[:3, 3] = self.rng.normal(size=3)
                return T
            case "color":
                # Smooth, so that JPEG can keep it.
                ramp = np.linspace(0, 255, AXES["width"])
                return np.broadcast_to(ramp[None, :, None], (480, 640, 3)).astype(np.uint8)
            case _:
                return self(annotation)

    def array(self, kind: Any) -> np.ndarray:
        shape = [int(axis) if axis.isdigit() else AXES[axis] for axis in kind.dim_str.split()]
        if kind.dtypes[0].startswith("uint"):
            return self.rng.integers(0, np.iinfo(kind.dtypes[0]).max, shape, dtype=kind.dtypes[0])
        if kind.dtypes[0] == "bool":
            return self.rng.random(shape) < 0.3
        return self.rng.normal(size=shape).astype(kind.dtypes[0])

    def approved(self, **proposed: Any) -> Approved:
        """Approval of a motion, made by the gate."""
        gate = ApprovalGate(max_age_s=1e9, max_unseen_s=1e9, max_drift_m=1e9)
        proposal = self(Proposal, **proposed)
        gate.show(proposal)
        decision = self(
            Decision,
            cause=(proposal.id,),
            proposal_id=proposal.id,
            digest=proposal.motion.digest(),
            approve=True,
        )
        self.shown.append((proposal, decision))
        return gate.approve(decision, latest=self(Particles), now_s=proposal.time_s)


def same(a: Any, b: Any) -> bool:
    """True if two values of the vocabulary are equal, number by number; NaN equals NaN."""
    if dataclasses.is_dataclass(a):
        names = [field.name for field in dataclasses.fields(a)]
        return type(a) is type(b) and all(same(getattr(a, name), getattr(b, name)) for name in names)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and bool(np.array_equal(a, b, equal_nan=a.dtype.kind == "f"))
    if isinstance(a, Mapping):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(itertools.starmap(same, zip(a, b, strict=True)))
    return type(a) is type(b) and (a == b or (a != a and b != b))


def same_as_read(written: Message, read: Message) -> bool:
    """True if `read` is `written` as a reader has to return it: exact, but for JPEG's colours and the gate's seal."""
    if isinstance(written, Approved):
        names = [field.name for field in dataclasses.fields(ApprovalRecord)]
        return isinstance(read, ApprovalRecord) and all(same(getattr(written, n), getattr(read, n)) for n in names)
    if isinstance(written, Frame) and isinstance(read, Frame):
        off = np.abs(written.color.astype(int) - read.color.astype(int))
        return bool(off.max() <= 8) and same(dataclasses.replace(written, color=read.color), read)
    return same(written, read)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Recording:
    """A whole file and what was written to it."""

    path: Path
    messages: list[Message] = dataclasses.field(repr=False)


def record(folder: Path, episode: Episode, messages: list[Message]) -> Path:
    """A whole recording of `messages`."""

    async def run() -> Path:
        async with open_recording(folder, episode, Room()) as recorder:
            for message in messages:
                await recorder.write(message)
        return recorder.path

    return anyio.run(run)
