"""Models as TOML files: written by `dipac calibrate` and `dipac discover`, and read by `--model`.

Schema 1 has the simulator's parameters alone; 2 may have those of cameras and arm, and the provenance of an extension.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomli_w

from app.core.errors import RecordingError, UsageError
from app.core.messages import Extension, Model, Parameter, fresh_id
from app.core.system.disk import replacement
from app.core.task_name import TaskName, same_model
from app.recording.exchange.toml_file import finite_number, read_toml, refuse_unknown, whole_number, words

SCHEMA = 2
_READ = (1, 2)
_KEYS = ("schema", "task", "version", "loss_m2", "transition_count", "parameters", "apparatus", "extension")
_PARAMETER = ("value", "unit", "low", "high")


def save_model(path: Path, model: Model, *, notes: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write `model`; the file holds everything but the message's id, causes and time.

    `notes`: remarks for readers, by parameter; they are not read back.

    Raises UsageError where the file cannot be written.
    """
    table = {
        "schema": SCHEMA,
        "task": model.task,
        "version": model.version,
        "loss_m2": model.loss_m2,
        "transition_count": model.transition_count,
        "parameters": _entries(model.parameters, notes),
    }
    if model.apparatus:
        table["apparatus"] = _entries(model.apparatus, notes)
    if model.extension != Extension():
        table["extension"] = vars(model.extension) | {"recordings": dict(model.extension.recordings)}
    try:
        with replacement(path) as new:
            new.write_text(tomli_w.dumps(table), encoding="utf-8")
    except OSError as error:
        raise UsageError(f"Cannot write the model to {path}: {error.strerror}; choose another place with -o.") from None


def task_of(path: Path) -> str:
    """Full name of the task of the model in `path`. Raises as `load_model`."""
    return _read(path, 0.0).task


def load_model(path: Path, *, task: str, time_s: float, whole: bool = True) -> Model:
    """The model in `path`, as a message dated `time_s`; where not `whole`, with any dynamics of the task.

    One of another split of the task is as good, and becomes a model of this one.

    Raises UsageError where the file is missing or belongs to another task, RecordingError where it is not a model.
    Unknown parameters and values out of range are left to the task to reject (`app.jobs.worker_api.check_model`).
    """
    model = _read(path, time_s)
    if model.task == task:
        return model
    dynamics = TaskName.parse(model.task).dynamics
    if not same_model(model.task, task, whole=whole):
        same = same_model(model.task, task, whole=False)
        step = f"give --dynamics {dynamics}" if same else "calibrate one for it"
        raise UsageError(f"{path} is a model of task {model.task!r}, not of {task!r}; {step}.")
    return replace(model, task=str(replace(TaskName.parse(task), dynamics=dynamics)))


def _read(path: Path, time_s: float) -> Model:
    try:
        table = read_toml(path)
        if whole_number("schema", table["schema"]) not in _READ:
            raise RecordingError(
                f"{path} has model schema {table['schema']}; this version reads schema {_READ[0]} and {_READ[1]}. "
                "Use the version of dipac that wrote it, or calibrate again."
            )
        return _model(table, time_s)
    except OSError as error:
        raise UsageError(f"Cannot read the model {path}: {error.strerror}.") from None
    except (KeyError, TypeError, AttributeError, ArithmeticError, ValueError) as error:
        why = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise RecordingError(
            f"{path} is not a model file ({why}); `dipac calibrate` and `dipac discover` write one."
        ) from None


def _entries(parameters: tuple[Parameter, ...], notes: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    entries = {p.name: {k: v for k, v in asdict(p).items() if k != "name"} for p in parameters}
    return {name: entry | ({"note": notes[name]} if name in notes else {}) for name, entry in entries.items()}


def _model(table: dict[str, Any], time_s: float) -> Model:
    refuse_unknown("", table, _KEYS)
    return Model(
        id=fresh_id("model"),
        time_s=time_s,
        version=whole_number("version", table["version"]),
        task=str(table["task"]),
        parameters=_parameters("parameters", table["parameters"]),
        loss_m2=float(table["loss_m2"]),
        transition_count=whole_number("transition_count", table["transition_count"]),
        apparatus=_parameters("apparatus", table.get("apparatus", {})),
        extension=_extension(table["extension"]) if "extension" in table else Extension(),
    )


def _parameters(part: str, entries: Mapping[str, Any]) -> tuple[Parameter, ...]:
    return tuple(_parameter(f"{part}.{name}", name, entry) for name, entry in entries.items())


def _parameter(place: str, name: str, entry: Mapping[str, Any]) -> Parameter:
    """A parameter of the file. Raises ValueError, which names the `place` in the file and the key."""
    for key in _PARAMETER:
        if key not in entry:
            raise ValueError(f"[{place}] lacks {key!r}")
    refuse_unknown(f"[{place}] ", entry, (*_PARAMETER, "note"))
    value, low, high = (finite_number(f"[{place}] {key}", entry[key]) for key in ("value", "low", "high"))
    if low > high:
        raise ValueError(f"[{place}] low = {low:g} is above high = {high:g}; they are the ends of its interval")
    return Parameter(name=name, value=value, unit=str(entry["unit"]), low=low, high=high)


def _extension(entry: Mapping[str, Any]) -> Extension:
    """The extension. Raises ValueError where the covariance does not fit the names, or `camera_m` is no point."""
    refuse_unknown("[extension] ", entry, [each.name for each in fields(Extension)])
    estimated = words("extension.estimated", entry["estimated"])
    covariance = tuple(
        tuple(finite_number("extension.covariance", value) for value in row) for row in entry["covariance"]
    )
    camera_m = tuple(finite_number("extension.camera_m", value) for value in entry["camera_m"])
    if any(len(rows) != len(estimated) for rows in (covariance, *covariance)):
        raise ValueError(f"extension.covariance must have a row and a column for each of {len(estimated)} estimated")
    if len(camera_m) not in (0, 3):
        raise ValueError(f"extension.camera_m must be x, y, z, not {len(camera_m)} numbers")
    return Extension(
        effects=words("extension.effects", entry["effects"]),
        camera_m=camera_m,
        estimated=estimated,
        covariance=covariance,
        recordings={str(name): str(digest) for name, digest in entry["recordings"].items()},
    )
