"""Round trips of arrays: `dipac import` reads what `dipac recordings export --to npz` writes, for every task."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.commands.import_ import import_
from app.core.geometry.scene_description import Rope
from app.core.messages import Episode, Particles, Sighting
from app.recording.read.clouds import write_npz
from app.recording.read.reader import read_messages
from app.tasks import load, names
from app.tasks.elements.base import Task
from tests.plain_data import plain_arrays, saved


def measured(task: Task) -> dict[str, Any]:
    """Pushes of a rope for tasks with one, and motions of something as large for the others."""
    arrays = plain_arrays()
    # The arm's log in the command's rhythm: a recording has both at the same times.
    for name in ("time", "pose", "episode"):
        arrays[f"state_{name}"] = arrays[f"command_{name}"]
    own = {"kind": "rope", "length_m": 0.4} if isinstance(task.stage.body, Rope) else {"kind": "heap"}
    arrays["about"] = np.array(json.dumps({"task": task.name, "object": own, "of": "somebody's log"}))
    return arrays


@pytest.mark.parametrize("name", names())
def test_what_was_imported_is_exported_as_it_was(name: str, tmp_path: Path) -> None:
    arrays, task = measured(load(name)), load(name)
    recording, file = tmp_path / "one.mcap", tmp_path / "again.npz"
    import_(saved(tmp_path, arrays), output=recording)
    write_npz(recording, file)
    with np.load(file, allow_pickle=False) as again:
        assert set(again.files) == set(arrays)
        for key in sorted(set(arrays) - {"about", "cloud_push"}):
            if key.endswith("_pose"):  # Interpolated at its own times.
                np.testing.assert_allclose(again[key], _while_seen(arrays, key), atol=1e-12)
            else:
                assert np.array_equal(again[key], _while_seen(arrays, key)), key
        # Pushes are counted through: each keeps its clouds.
        assert np.array_equal(np.diff(again["cloud_push"]) != 0, np.diff(arrays["cloud_push"]) != 0)
        about = json.loads(str(again["about"]))
    assert about == {**json.loads(str(arrays["about"])), "task": load(about["task"]).recorded_name}
    assert load(about["task"]).problem == task.problem


@pytest.mark.parametrize("name", names())
def test_what_was_exported_is_imported_as_it_was(name: str, tmp_path: Path) -> None:
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    import_(saved(tmp_path, measured(load(name))), output=first)
    write_npz(first, tmp_path / "exported.npz")
    import_(tmp_path / "exported.npz", output=second)
    assert [_said(message) for message in read_messages(first, KINDS)] == [
        _said(message) for message in read_messages(second, KINDS)
    ]


KINDS = [Episode, Particles, Sighting]


def _said(message: object) -> object:
    match message:
        case Episode():
            return message.task
        case Particles():
            return message.time_s, message.surface.tobytes(), message.positions.tobytes()
        case Sighting():
            return message.time_s, message.tool.tobytes(), message.table.tobytes()
        case _:
            raise AssertionError(message)


def _while_seen(arrays: dict[str, Any], name: str) -> np.ndarray:
    """An array, of tracks only what lies between the views before and after a push: that is what is recorded."""
    if not name.startswith(("command_", "state_")):
        return arrays[name]
    times, phases = arrays["cloud_time"], arrays["cloud_phase"]
    begins, ends = times[phases == "before"], times[phases == "after"]
    at = arrays[f"{name.split('_')[0]}_time"]
    kept = ((at[:, None] >= begins) & (at[:, None] <= ends)).any(1)
    return arrays[name][kept]
