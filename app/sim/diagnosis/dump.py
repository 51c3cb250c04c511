"""One failed simulation as one file: an .npz of arrays with a header in JSON, and nothing in it that is executed.

It says which engine simulated: material points or rods. A scene is rebuilt from the materials, tools and effects of
this version alone, by their names; any other is refused.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, final

import jax.numpy as jnp
import numpy as np

from app import __version__
from app.core.errors import DipacError, RecordingError, UsageError
from app.core.system.array_file import read_arrays
from app.core.system.disk import replacement
from app.sim.diagnosis.failure_diagnosis import MpmCase
from app.sim.diagnosis.rod_dump import rod_arrays, rod_case_of, rod_header
from app.sim.diagnosis.rod_failure_diagnosis import RodCase
from app.sim.model.entries import check_parameters, effect_names, fields_entry, from_entry, named_effects
from app.sim.model.registry import known_materials, known_tools
from app.sim.model.scene import Body, Scene
from app.sim.runtime.checks import Setup, require_shapes
from app.sim.state import Setting, State

FORMAT = "dipac simulation dump"
SCHEMA = 1
_POINTS, _RODS = "mpm", "rods"
"""Engines; a dump that names none is of the first."""


def versions() -> dict[str, str]:
    """Versions of this package and of the numerical libraries, by name."""
    return {"dipac": __version__} | {name: metadata.version(name) for name in ("jax", "numpy", "warp-lang")}


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Dump:
    """A case, its description in words, and the versions that computed it."""

    case: MpmCase | RodCase
    about: str
    versions: Mapping[str, str] = field(default_factory=versions)


def save_dump(path: Path, dump: Dump) -> None:
    """Write the file, whole or not at all.

    Raises UsageError where it cannot be written, or where the scene has a material, tool or effect that is not of this
    package's folders.
    """
    _write(path, _bytes_of(dump))


def leave_dump(folder: Path, dump: Dump) -> Path:
    """Write it into `folder`, which is made if need be, under a name of its own: the same case has the same name."""
    content = _bytes_of(dump)
    path = folder / f"failed-{hashlib.sha256(content).hexdigest()[:10]}.npz"
    _write(path, content)
    return path


def load_dump(path: Path) -> Dump:
    """The dump in `path`.

    Raises UsageError where the file cannot be read, RecordingError where it is no dump, a damaged one, or of a version
    that this one cannot replay.
    """
    try:
        entries = read_arrays(path)
        header = json.loads(str(entries["header"]))
        if header["format"] != FORMAT:
            raise KeyError("format")
    except OSError as error:
        raise UsageError(f"Cannot read the dump {path}: {error.strerror or error}.") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise RecordingError(
            f"{path} is not a dump of a simulation ({type(error).__name__}: {error}); a failed simulation names the "
            "one that it left."
        ) from None
    if header.get("schema") != SCHEMA:
        raise RecordingError(
            f"{path} has dump schema {header.get('schema')}, written by dipac {header.get('versions')}; this version "
            f"reads schema {SCHEMA}: replay it with the version that wrote it."
        )
    try:
        return _dump_of(header, entries)
    except (DipacError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RecordingError(
            f"{path} cannot be replayed by dipac {__version__} ({error}); replay it with the version that wrote it, "
            f"{header.get('versions')}."
        ) from None


def _bytes_of(dump: Dump) -> bytes:
    case = dump.case
    rods = isinstance(case, RodCase)
    header = {
        "format": FORMAT,
        "schema": SCHEMA,
        "engine": _RODS if rods else _POINTS,
        "versions": dict(dump.versions),
        "about": dump.about,
        **(rod_header(case) if rods else _header(case)),
    }
    arrays = rod_arrays(case) if rods else _arrays(case)
    stream = io.BytesIO()
    entries = {name: np.asarray(value, np.float32) for name, value in arrays.items()}
    text = {"header": np.array(json.dumps(header, allow_nan=False))}
    np.savez_compressed(stream, allow_pickle=False, **text, **entries)
    return stream.getvalue()


def _write(path: Path, content: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacement(path) as new:
            new.write_bytes(content)
    except OSError as error:
        raise UsageError(f"Cannot write the dump {path}: {error.strerror}; choose another folder.") from None


def _dump_of(header: dict[str, Any], entries: Mapping[str, np.ndarray]) -> Dump:
    arrays = {name: np.asarray(value, np.float32) for name, value in entries.items() if name != "header"}
    engines = {_POINTS: _case_of, _RODS: rod_case_of}
    engine = header.get("engine", _POINTS)
    if engine not in engines:
        raise UsageError.unknown("engine", engine, engines)
    return Dump(case=engines[engine](header, arrays), about=str(header["about"]), versions=header["versions"])


def _header(case: MpmCase) -> dict[str, Any]:
    return {
        "scene": _scene_entry(case.setup.scene),
        "counts": list(case.setup.counts),
        "effects": effect_names(case.setup.effects),
        "parameters": [spec.name for spec in case.setup.specs()],
    }


def _arrays(case: MpmCase) -> dict[str, Any]:
    return {"phi": case.phi, "tool": case.tool, **case.state._asdict(), **case.setting._asdict()}


def _case_of(header: Mapping[str, Any], values: Mapping[str, np.ndarray]) -> MpmCase:
    setup = Setup(
        scene=_scene_of(header["scene"]),
        counts=tuple(int(count) for count in header["counts"]),
        effects=named_effects(header["effects"]),
    )
    check_parameters(setup.specs(), header["parameters"])
    case = MpmCase(
        setup=setup,
        phi=values["phi"],
        state=State(**{name: jnp.asarray(values[name]) for name in State._fields}),
        tool=values["tool"],
        setting=Setting(**{name: jnp.asarray(values[name]) for name in Setting._fields}),
    )
    require_shapes(case.phi, case.state, case.tool, case.setting, setup.sizes())
    return case


def _scene_entry(scene: Scene) -> dict[str, Any]:
    bodies = [
        fields_entry(body, without=("material",)) | {"material": _entry("material", body.material, known_materials())}
        for body in scene.bodies
    ]
    tools = [_entry("tool", tool, known_tools()) for tool in scene.tools]
    return fields_entry(scene, without=("bodies", "tools")) | {"bodies": bodies, "tools": tools}


def _scene_of(entry: Mapping[str, Any]) -> Scene:
    numbers = {name: from_entry(value) for name, value in entry.items() if name not in ("bodies", "tools")}
    bodies = tuple(
        Body(
            **{name: from_entry(value) for name, value in body.items() if name != "material"},
            material=_object("material", body["material"], known_materials()),
        )
        for body in entry["bodies"]
    )
    tools = tuple(_object("tool", tool, known_tools()) for tool in entry["tools"])
    return Scene(**numbers, bodies=bodies, tools=tools)


def _entry(kind: str, given: Any, known: Mapping[str, type]) -> dict[str, Any]:
    """A material or tool by its name and fields; its law is that of its class."""
    names = {each: name for name, each in known.items()}
    if type(given) not in names:
        raise UsageError.unknown(kind, type(given).__name__, known)
    if getattr(given, "law", None) is not getattr(type(given), "law", None):
        raise UsageError(f"The {kind} {type(given).__name__} has a law of its own; only the package's can be dumped.")
    return {"class": names[type(given)], "fields": fields_entry(given, without=("law",))}


def _object(kind: str, entry: Mapping[str, Any], known: Mapping[str, type]) -> Any:
    if entry["class"] not in known:
        raise UsageError.unknown(kind, entry["class"], known)
    fields = {name: from_entry(each) for name, each in entry["fields"].items() if name != "law"}
    return known[entry["class"]](**fields)
