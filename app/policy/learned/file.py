"""Learned policies as files: numbers in safetensors, everything else as JSON in their header. No pickle anywhere."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from flax.errors import FlaxError
from flax.traverse_util import flatten_dict, unflatten_dict
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from app.core.errors import RecordingError, UsageError
from app.core.system.disk import replacement
from app.policy.base import PlanningState
from app.policy.learned import kinds
from app.policy.learned.base import LearnedPolicy, Learner, Lessons, Params, Scale
from app.policy.learned.train import Progress, Training

SCHEMA: Final = 1
FILE: Final = "policy.safetensors"
CHECKPOINT: Final = "checkpoint.safetensors"
"""Their names in the folder that `dipac train` writes."""
_HEADER: Final = "dipac"
_FEW: Final = 60
"""Particles of a situation that a policy is tried in."""
Arrays: TypeAlias = dict[str, np.ndarray]


@final
@dataclass(frozen=True, kw_only=True)
class Origin:
    """Provenance of a policy: task, kind, training settings, and its data (SHA-256 by file)."""

    task: str
    kind: str
    seed: int
    steps: int
    held_out_loss: float
    code_version: str
    command: str
    demonstrations: Mapping[str, str] = field(default_factory=dict[str, str])


def save_policy(path: Path, policy: LearnedPolicy, origin: Origin) -> None:
    """Write it, in half precision. Raises UsageError where the file cannot be written."""
    arrays = {f"params/{name}": value.astype(np.float16) for name, value in _flat(policy.params).items()}
    arrays |= {"scale/mean": np.asarray(policy.scale.mean), "scale/std": np.asarray(policy.scale.std)}
    header = {
        "schema": SCHEMA,
        "origin": asdict(origin),
        "learner": asdict(policy.learner),  # type: ignore[call-overload] - learners are frozen dataclasses.
        "shape": shape_of(policy.how),
    }
    _write(path, arrays, header)


def load_policy(path: Path, *, task: str, how: Lessons) -> tuple[LearnedPolicy, Origin]:
    """The policy in the file, or in `FILE` of that folder, and where it is from; `how` the task has it.

    Raises UsageError where it is not there, of another task, or of one that had other actions or views; RecordingError
    where it is none.
    """
    arrays, header = _read(path / FILE if path.is_dir() else path)
    try:
        origin, shape = Origin(**header["origin"]), header["shape"]
        # A number that it does not have is what it was before there was such a number: the class says it.
        learner: Learner = type(kinds.load(origin.kind))(**header["learner"])
        params, scale = _unflatten_params(arrays, "params/"), Scale(arrays["scale/mean"], arrays["scale/std"])
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path} is no policy of this version ({error}); train it again.") from None
    if origin.task != task:
        raise UsageError(f"{path} holds a policy of {origin.task}, not of {task}; train one of that.")
    if shape != json.loads(json.dumps(shape_of(how))):
        raise UsageError(f"{path} was trained for other actions or views than {task} has now; train it again.")
    policy = LearnedPolicy.of(learner, how, params, scale)
    _check(path, policy)
    return policy, origin


def _check(path: Path, policy: LearnedPolicy) -> None:
    """Raises RecordingError where an array is missing, of another shape, or holds what is no number."""
    few = np.zeros((_FEW, 3), np.float32)
    try:
        made = jax.eval_shape(
            policy.act, policy.prepare(few, few), PlanningState.at_rest(jnp.asarray(few)[None])
        ).mean.shape
        wrong = "" if made == (1, int(np.prod(policy.how.space.chunk))) else f"it makes actions of {made}"
    except (FlaxError, TypeError, ValueError) as error:
        wrong = str(error).splitlines()[0]
    if not all(np.isfinite(leaf).all() for leaf in jax.tree_util.tree_leaves((policy.params, tuple(policy.scale)))):
        wrong = "some of its numbers are none"
    if wrong:
        raise RecordingError(f"{path} holds no whole policy ({wrong}); train it again.")


def save_training(path: Path, training: Training, settings: Mapping[str, Any]) -> None:
    """Write the whole state of training. Raises UsageError if the file cannot be written."""
    arrays = {f"params/{name}": value for name, value in _flat(training.params).items()}
    arrays |= {f"best/{name}": value for name, value in _flat(training.best).items()}
    leaves = jax.tree_util.tree_leaves(training.optimiser)
    arrays |= {f"optimiser/{index:05}": np.asarray(leaf) for index, leaf in enumerate(leaves)}
    told = {name: getattr(training, name) for name in ("step", "best_loss", "idle", "curve")}
    _write(path, arrays, {"schema": SCHEMA, "training": told, "settings": dict(settings)})


def load_training(path: Path, begun: Training, settings: Mapping[str, Any]) -> Training:
    """The state of training that `save_training` wrote, in the structure of `begun`.

    Raises UsageError if its settings were others, RecordingError if the file is no checkpoint.
    """
    arrays, header = _read(path)
    try:
        if header["settings"] != json.loads(json.dumps(dict(settings))):
            raise UsageError(f"{path} was begun with other options or demonstrations; give the same, or another -o.")
        leaves = [jnp.asarray(arrays[name]) for name in sorted(arrays) if name.startswith("optimiser/")]
        optimiser = jax.tree_util.tree_unflatten(jax.tree_util.tree_structure(begun.optimiser), leaves)
        told = header["training"]
        return Training(
            params=_unflatten_params(arrays, "params/"),
            best=_unflatten_params(arrays, "best/"),
            optimiser=optimiser,
            step=int(told["step"]),
            best_loss=float(told["best_loss"]),
            idle=int(told["idle"]),
            curve=[Progress(*each) for each in told["curve"]],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path} is no checkpoint of this version ({error}); choose another -o.") from None


def _flat(params: Params) -> Arrays:
    return {str(name): np.asarray(value) for name, value in flatten_dict(dict(params), sep="/").items()}


def _unflatten_params(arrays: Arrays, prefix: str) -> Params:
    chosen = {name.removeprefix(prefix): value for name, value in arrays.items() if name.startswith(prefix)}
    nested: Params = unflatten_dict({name: jnp.asarray(value, jnp.float32) for name, value in chosen.items()}, sep="/")
    return nested


def shape_of(how: Lessons) -> dict[str, Any]:
    """The task's properties that a network is tied to: shape of its actions, views and symmetry."""
    return {"chunk": how.space.chunk, "views": [asdict(view) for view in how.views], "symmetry": asdict(how.symmetry)}


def _write(path: Path, arrays: Arrays, header: Mapping[str, Any]) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        whole = {name: np.asarray(value, order="C") for name, value in arrays.items()}
        with replacement(path) as new:
            save_file(whole, new, {_HEADER: json.dumps(header)})
    except (OSError, SafetensorError) as error:
        raise UsageError(f"Cannot write {path}: {error}; choose another place with -o.") from None


def _read(path: Path) -> tuple[Arrays, dict[str, Any]]:
    if not path.is_file():
        raise UsageError(f"There is no policy {path}; `dipac train` makes one.")
    try:
        with safe_open(path, framework="numpy") as stored:
            header = json.loads((stored.metadata() or {})[_HEADER])
            arrays = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118 - it is no mapping.
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise RecordingError(f"{path} holds no policy ({error}); train it again.") from None
    if header.get("schema") != SCHEMA:
        raise RecordingError(
            f"{path} has policy schema {header.get('schema')}, and this version reads {SCHEMA}; train it again."
        )
    return arrays, header
