"""The folder of a LeRobot dataset: parquet files of steps and episodes, their features, and their statistics.

Files and fields are those of LeRobot's format v3.0 (lerobot 0.6): `meta/info.json`, `meta/stats.json`,
`meta/tasks.parquet`, `meta/episodes/chunk-000/file-000.parquet`, `data/chunk-000/file-000.parquet`. Colours are stored
as the JPEG files of the recording, so nothing is encoded twice, and depth without loss. The format says of no camera
where it is; `MAPPING` does, for `dipac import`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

import numpy as np

from app.core.errors import PreflightError, UsageError
from app.recording.exchange.lerobot import stats
from app.recording.exchange.lerobot.mapping import ACTION, GOAL, IMAGE, MAPPING, OBJECT, STATE, depth_key, mapping
from app.recording.exchange.lerobot.samples import STATE_NAMES, CameraImages, Samples, read_samples
from app.recording.library.label import labels

FORMAT: Final = "v3.0"
_FILE: Final = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_DATA: Final = f"data/{_FILE}.parquet"
_IMAGES_AN_EPISODE: Final = 4
"""Images of each camera and episode that enter the statistics of the dataset."""
_CHUNK_FILES, _FILE_MB, _VIDEO_MB = 1000, 100, 200
"""LeRobot's own defaults."""
_DICTIONARY_BYTES: Final = 2**28
"""Images of an episode that are kept once each, although many steps show them; the rest as often as they are shown."""
_COUNTED: Final = {"frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}


class Exported(NamedTuple):
    """Number of episodes and steps written; `is_placed`: true where the cameras are the same in all of them."""

    episodes: int
    steps: int
    is_placed: bool


def export(
    paths: Sequence[Path],
    folder: Path,
    *,
    fps: int,
    rest_s: float = 0.0,
    done: Callable[[Path], object] = lambda _: None,
) -> Exported:
    """Write the recordings as a new dataset at `folder`, an episode each, with `rest_s` after each motion.

    `done` is called after each.

    Raises UsageError where the folder is not empty, PreflightError where the packages that write parquet files are
    missing, and RecordingError where a recording cannot be sampled or differs in kind from the first.
    """
    tools = _Tools.load()
    if folder.exists() and any(folder.iterdir()):
        raise UsageError(f"{folder} is not empty; choose another folder with -o, so that nothing is written over.")
    folder.mkdir(parents=True, exist_ok=True)
    rows = list[dict[str, Any]]()
    tasks = dict[str, int]()
    told: list[Mapping[str, np.ndarray]] = []
    images = dict[str, list[bytes]]()
    features: dict[str, Any] = {}
    views: list[tuple[str, Mapping[str, CameraImages]]] = []
    steps = 0
    with _Steps(tools, folder) as writer:
        for index, (path, samples) in enumerate(read_samples(paths, fps, rest_s)):
            features = features or _features(samples)
            task = tasks.setdefault(samples.episode.task.replace("_", " "), len(tasks))
            numbers = _numbers(samples, fps=fps, episode=index, first=steps, task=task, success=_is_success(path))
            own = _files(samples)
            place = writer.write(numbers, own, features)
            rows.append(_row(index, samples, steps, place, _describe(numbers, own, features)))
            told.append(numbers)
            views.append((samples.episode.task, {name: it.without_files() for name, it in samples.images.items()}))
            for key, pictures in own.items():
                images.setdefault(key, []).extend(pictures[:: max(1, len(pictures) // _IMAGES_AN_EPISODE)])
            steps += len(samples)
            done(path)
    _write_meta(tools, folder, features, rows, tasks, fps=fps, steps=steps)
    whole = {key: np.concatenate([numbers[key] for numbers in told]) for key in told[0]}
    told_of_all = json.dumps(_describe(whole, images, features), indent=4)
    (folder / "meta" / "stats.json").write_text(told_of_all, encoding="utf-8")
    streams = mapping(views, fps)
    if streams is not None:
        (folder / MAPPING).write_text(streams.toml(), encoding="utf-8")
    return Exported(len(rows), steps, streams is not None)


def _files(samples: Samples) -> dict[str, Sequence[bytes]]:
    """Files of the images of each step, by feature."""
    jpeg = {f"{IMAGE}{name}": it.jpeg for name, it in samples.images.items()}
    return jpeg | {depth_key(name): it.depth for name, it in samples.images.items() if it.depth}


class _Tools(NamedTuple):
    """The optional packages of the export."""

    datasets: ModuleType
    arrow: ModuleType
    parquet: ModuleType

    @classmethod
    def load(cls) -> _Tools:
        try:
            import datasets
            import pyarrow
            import pyarrow.parquet
        except ImportError as error:
            raise PreflightError(
                f"LeRobot's format needs the package {error.name!r}; install it with `pip install 'dipac[lerobot]'`."
            ) from None
        return cls(datasets, pyarrow, pyarrow.parquet)


class _Steps:
    """The data files. One is full at LeRobot's size; an episode lies within one of them."""

    def __init__(self, tools: _Tools, folder: Path) -> None:
        self._tools, self._folder = tools, folder
        self._file, self._bytes = 0, 0
        self._writer: Any = None

    def __enter__(self) -> _Steps:
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()

    def write(
        self, numbers: Mapping[str, np.ndarray], images: Mapping[str, Sequence[bytes]], features: Mapping[str, Any]
    ) -> tuple[int, int]:
        """Append an episode; returns the indices of its chunk and file."""
        schema = _schema(self._tools, features)
        columns: dict[str, Any] = {key: value.tolist() for key, value in numbers.items()}
        columns |= {key: [{"bytes": data, "path": None} for data in of_one] for key, of_one in images.items()}
        table = self._tools.arrow.Table.from_pydict(columns, schema=schema)
        size = _stored_bytes(numbers, images)
        if self._writer is not None and self._bytes + size > _FILE_MB * 2**20:
            self._writer.close()
            self._writer, self._file, self._bytes = None, self._file + 1, 0
        place = divmod(self._file, _CHUNK_FILES)
        if self._writer is None:
            path = self._folder / _DATA.format(chunk_index=place[0], file_index=place[1])
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = self._tools.parquet.ParquetWriter(
                path, schema, compression="snappy", dictionary_pagesize_limit=_DICTIONARY_BYTES
            )
        self._writer.write_table(table)
        self._bytes += size
        return place


def _stored_bytes(numbers: Mapping[str, np.ndarray], images: Mapping[str, Sequence[bytes]]) -> int:
    """Size of an episode in a file, where images that several steps show are kept once."""
    files = {data for of_one in images.values() for data in of_one}
    return sum(map(len, files)) + sum(value.nbytes for value in numbers.values())


def _features(samples: Samples) -> dict[str, Any]:
    """Features of a step, in LeRobot's description."""
    count, goal = samples.object.shape[1], samples.goal.shape[1]
    axes = ["height", "width", "channels"]
    color = {f"{IMAGE}{name}": _feature("image", (*it.size, 3), axes) for name, it in samples.images.items()}
    depth = {
        depth_key(name): _feature("image", (*it.size, 1), axes)
        | {"info": {"is_depth_map": True, "depth_unit": it.depth_unit}}
        for name, it in samples.images.items()
        if it.depth
    }
    return {
        STATE: _feature("float32", (8,), list(STATE_NAMES)),
        ACTION: _feature("float32", (8,), list(STATE_NAMES)),
        OBJECT: _feature("float32", (3 * count,), None),
        GOAL: _feature("float32", (3 * goal,), None),
        **color,
        **depth,
        "next.done": _feature("bool", (1,), None),
        "next.success": _feature("bool", (1,), None),
        "timestamp": _feature("float32", (1,), None),
        **{name: _feature(kind, (1,), None) for name, kind in _COUNTED.items()},
    }


def _feature(dtype: str, shape: tuple[int, ...], names: list[str] | None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": list(shape), "names": names}


def _schema(tools: _Tools, features: Mapping[str, Any]) -> Any:
    """The columns of a data file, with the metadata of the `datasets` package."""
    kinds = tools.datasets

    def kind(feature: Mapping[str, Any]) -> Any:
        if feature["dtype"] == "image":
            return kinds.Image()
        value = kinds.Value(feature["dtype"])
        return value if feature["shape"] == [1] else kinds.Sequence(value, length=feature["shape"][0])

    return kinds.Features({key: kind(feature) for key, feature in features.items()}).arrow_schema


def _numbers(
    samples: Samples, *, fps: int, episode: int, first: int, task: int, success: bool
) -> dict[str, np.ndarray]:
    """All features but images, a row a step."""
    count = len(samples)
    order, last = np.arange(count), np.arange(count) == count - 1
    return {
        STATE: samples.state,
        ACTION: samples.action,
        OBJECT: samples.object.reshape(count, -1),
        GOAL: samples.goal.reshape(count, -1),
        "next.done": last,
        "next.success": last & success,
        "timestamp": (order / fps).astype(np.float32),
        "frame_index": order,
        "episode_index": np.full(count, episode),
        "index": first + order,
        "task_index": np.full(count, task),
    }


def _is_success(path: Path) -> bool:
    said = labels(path)
    return bool(said) and said[-1].said == "success"


def _row(
    index: int,
    samples: Samples,
    first: int,
    place: tuple[int, int],
    described: Mapping[str, stats.Stats],
) -> dict[str, Any]:
    """Row of an episode in `meta/episodes`."""
    return {
        "episode_index": index,
        "tasks": [samples.episode.task.replace("_", " ")],
        "length": len(samples),
        "data/chunk_index": place[0],
        "data/file_index": place[1],
        "dataset_from_index": first,
        "dataset_to_index": first + len(samples),
        **{f"stats/{key}/{name}": value for key, of_one in described.items() for name, value in of_one.items()},
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }


def _write_meta(
    tools: _Tools,
    folder: Path,
    features: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
    tasks: Mapping[str, int],
    *,
    fps: int,
    steps: int,
) -> None:
    import pandas  # `datasets` brings it. LeRobot keeps the tasks as the index of a frame.

    meta = folder / "meta"
    episodes = meta / "episodes" / f"{_FILE.format(chunk_index=0, file_index=0)}.parquet"
    episodes.parent.mkdir(parents=True, exist_ok=True)
    tools.parquet.write_table(tools.arrow.Table.from_pylist(list(rows)), episodes)
    pandas.DataFrame({"task_index": list(tasks.values())}, index=list(tasks)).to_parquet(meta / "tasks.parquet")
    info = {
        "codebase_version": FORMAT,
        "robot_type": "kinova_gen3",
        "total_episodes": len(rows),
        "total_frames": steps,
        "total_tasks": len(tasks),
        "chunks_size": _CHUNK_FILES,
        "data_files_size_in_mb": _FILE_MB,
        "video_files_size_in_mb": _VIDEO_MB,
        "fps": fps,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": _DATA,
        "video_path": None,
        "features": features,
    }
    (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")


def _describe(
    numbers: Mapping[str, np.ndarray], images: Mapping[str, Sequence[bytes]], features: Mapping[str, Any]
) -> dict[str, stats.Stats]:
    """Statistics of each numeric or image feature."""
    told = {key: stats.of_numbers(_columns(value)) for key, value in numbers.items() if value.dtype != bool}
    for key, files in images.items():
        told[key] = stats.of_depth(files) if features[key]["shape"][2] == 1 else stats.of_images(files)
    return told


def _columns(value: np.ndarray) -> np.ndarray:
    return value.reshape(len(value), -1).astype(np.float64)
