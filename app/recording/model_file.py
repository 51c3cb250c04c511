"""Models as TOML files: what `dipac calibrate` writes and `--model` reads."""

import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomli_w

from app.core.errors import RecordingError, UsageError
from app.core.messages import Model, Parameter, fresh_id

SCHEMA = 1


def save_model(path: Path, model: Model) -> None:
    """Write `model`; the file holds everything but the message's id, causes and time.

    Raises UsageError where the file cannot be written.
    """
    table = {
        "schema": SCHEMA,
        "task": model.task,
        "version": model.version,
        "loss_m2": model.loss_m2,
        "transition_count": model.transition_count,
        "parameters": {p.name: {k: v for k, v in asdict(p).items() if k != "name"} for p in model.parameters},
    }
    try:
        path.write_text(tomli_w.dumps(table), encoding="utf-8")
    except OSError as error:
        raise UsageError(f"Cannot write the model to {path}: {error.strerror}; choose another place with -o.") from None


def load_model(path: Path, *, task: str, time_s: float) -> Model:
    """The model in `path`, as a message of now.

    Raises UsageError where the file is not there or belongs to another task, RecordingError where it is not a model.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        if table["schema"] != SCHEMA:
            raise RecordingError(f"{path} has model schema {table['schema']}; this version reads schema {SCHEMA}.")
        model = _model(table, time_s)
    except OSError as error:
        raise UsageError(f"Cannot read the model {path}: {error.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, KeyError, TypeError, AttributeError, ValueError) as error:
        raise RecordingError(
            f"{path} is not a model file ({type(error).__name__}: {error}); `dipac calibrate` writes one."
        ) from None
    if model.task != task:
        raise UsageError(f"{path} is a model of task {model.task!r}, not of {task!r}; calibrate one for it.")
    return model


def _model(table: dict[str, Any], time_s: float) -> Model:
    parameters = tuple(
        Parameter(
            name=name,
            value=float(entry["value"]),
            unit=str(entry["unit"]),
            low=float(entry["low"]),
            high=float(entry["high"]),
        )
        for name, entry in table["parameters"].items()
    )
    return Model(
        id=fresh_id("model"),
        time_s=time_s,
        version=int(table["version"]),
        task=str(table["task"]),
        parameters=parameters,
        loss_m2=float(table["loss_m2"]),
        transition_count=int(table["transition_count"]),
    )
