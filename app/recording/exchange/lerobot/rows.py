"""Steps of a LeRobot dataset: numbers by episode, and images that are stored in its parquet files."""

import io
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple, final

import numpy as np
from jaxtyping import Float64
from PIL import Image

from app.core.errors import PreflightError, RecordingError
from app.core.types import ColourImage
from app.recording.exchange.image_file import colours_in

_EPISODES: Final = "meta/episodes"
_DATA: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_METRES: Final = {"m": 1.0, "mm": 0.001}


class VideoPlace(NamedTuple):
    """Indices of a video file, and where an episode begins in it [s]."""

    chunk: int
    file: int
    from_s: float


@final
class DatasetRows:
    """Rows of the dataset at `path`. Raises RecordingError, naming the file, where one is missing or damaged."""

    def __init__(self, path: Path, info: Mapping[str, Any]) -> None:
        self._path, self._info, self._parquet = path, info, _load()
        self._tables: dict[tuple[str, str], Any] = {}
        self._images: tuple[tuple[str, str, int], Any] | None = None

    @property
    def episodes(self) -> list[int]:
        """Numbers of the episodes that have steps."""
        return sorted(number for number, row in self._episode_rows.items() if row.get("length", 1))

    def times(self, number: int) -> Float64[np.ndarray, " S"]:
        """Times of the steps of an episode [s], from its beginning."""
        times = self.numbers(number, "timestamp")[:, 0]
        return np.round(times - times[0], 6)

    def numbers(self, number: int, name: str) -> Float64[np.ndarray, "S D"]:
        """Values of a feature at the steps of an episode."""
        file = self._file_of(number)
        column = self._column(file, name)
        own = self._column(file, "episode_index")[:, 0] == number
        if not own.any():
            raise RecordingError(f"{self._path / file} holds no step of episode {number}; download the dataset again.")
        return column[own]

    def color(self, number: int, name: str, time_s: float) -> ColourImage:
        """The image of a feature at the step next to a time."""
        data = self._image(number, name, time_s)
        try:
            return colours_in(data)
        except (OSError, ValueError) as error:
            raise RecordingError(f"{self._path}: an image of {name} cannot be decoded ({error}).") from None

    def depth_m(self, number: int, name: str, time_s: float) -> Float64[np.ndarray, "height width"]:
        """Depth [m] of a feature at the step next to a time; 0 without a reading."""
        try:
            with Image.open(io.BytesIO(self._image(number, name, time_s))) as image:
                values = np.asarray(image)
        except (OSError, ValueError, SyntaxError) as error:
            raise RecordingError(f"{self._path}: a depth image of {name} cannot be decoded ({error}).") from None
        if values.ndim != 2 or values.dtype.itemsize < 2:
            raise RecordingError(
                f"{self._path}: {name} holds images of 8 bits, no depth; leave it out of the file of --topics."
            )
        info: Any = self._info["features"][name].get("info") or {}
        unit_m = _METRES.get(info.get("depth_unit", ""), 1.0 if values.dtype.kind == "f" else _METRES["mm"])
        return values.astype(np.float64) * unit_m

    def video_place(self, number: int, name: str) -> VideoPlace:
        """Place of an episode in the video of a feature."""
        row, key = self._episode_rows[number], f"videos/{name}/"
        try:
            return VideoPlace(
                int(row[f"{key}chunk_index"]), int(row[f"{key}file_index"]), float(row[f"{key}from_timestamp"])
            )
        except (KeyError, TypeError, ValueError):
            raise RecordingError(
                f"{self._path / _EPISODES} does not say where the video of {name} has episode {number}; download the "
                "dataset again, or leave the camera out of the file of --topics."
            ) from None

    @cached_property
    def _episode_rows(self) -> dict[int, dict[str, Any]]:
        files = sorted((self._path / _EPISODES).glob("*/*.parquet"))
        if not files:
            raise RecordingError(f"{self._path / _EPISODES} holds no parquet file; download the dataset again.")
        rows = dict[int, dict[str, Any]]()
        for file in files:
            with _explain_errors(file):
                parquet = self._parquet.ParquetFile(file)
                names = [it for it in parquet.schema_arrow.names if not it.startswith("stats/")]
                found = parquet.read(columns=names).to_pylist()
            for row in found:
                rows[int(row.get("episode_index") or len(rows))] = row
        return rows

    def _file_of(self, number: int) -> str:
        row = self._episode_rows[number]
        chunk, file = (row.get(f"data/{name}_index") for name in ("chunk", "file"))
        if not isinstance(chunk, int) or not isinstance(file, int):
            raise RecordingError(
                f"{self._path / _EPISODES} does not say in which file episode {number} is; download the dataset again."
            )
        return path_of(self._info, "data_path", _DATA, chunk_index=chunk, file_index=file)

    def _column(self, file: str, name: str) -> Float64[np.ndarray, "S D"]:
        """A column of numbers as rows of equal length."""
        if (file, name) not in self._tables:
            with _explain_errors(self._path / file):
                parquet = self._parquet.ParquetFile(self._path / file)
                if name not in parquet.schema_arrow.names:
                    raise RecordingError(f"{self._path / file} has no column {name!r}; download the dataset again.")
                values = parquet.read(columns=[name]).column(0).to_pylist()
            try:
                array = np.array(values, np.float64)
            except (TypeError, ValueError):
                raise RecordingError(
                    f"{self._path / file}: the values of {name} are no numbers of one shape."
                ) from None
            self._tables[file, name] = array.reshape(len(array), -1)
        return self._tables[file, name]

    def _image(self, number: int, name: str, time_s: float) -> bytes:
        file = self._file_of(number)
        own = np.flatnonzero(self._column(file, "episode_index")[:, 0] == number)
        index = int(own[np.argmin(np.abs(self.times(number) - time_s))])
        with _explain_errors(self._path / file):
            parquet, first = self._parquet.ParquetFile(self._path / file), 0
            for group in range(parquet.num_row_groups):
                count = parquet.metadata.row_group(group).num_rows
                if index < first + count:
                    value = self._group(parquet, file, name, group)[index - first].as_py()
                    return self._bytes_of(value, name)
                first += count
        raise RecordingError(f"{self._path / file} has no row {index}; download the dataset again.")

    def _group(self, parquet: Any, file: str, name: str, group: int) -> Any:
        """Images of a row group; the last one asked for is kept."""
        key = (file, name, group)
        if self._images is None or self._images[0] != key:
            self._images = key, parquet.read_row_group(group, columns=[name]).column(0)
        return self._images[1]

    def _bytes_of(self, value: Any, name: str) -> bytes:
        """Bytes of an image, in the table or in a file beside it."""
        data = value.get("bytes") if isinstance(value, dict) else None
        if isinstance(data, bytes):
            return data
        place = value.get("path") if isinstance(value, dict) else None
        try:
            if isinstance(place, str):
                return (self._path / place).read_bytes()
        except OSError:
            pass
        raise RecordingError(f"{self._path}: an image of {name} is not there ({place}); download the dataset again.")


def path_of(info: Mapping[str, Any], key: str, own: str, **parts: Any) -> str:
    """A path within the dataset, by the pattern that `info` has under `key`, or LeRobot's `own`.

    Raises RecordingError where the pattern is none, or leads out of the dataset.
    """
    form = str(info.get(key) or own)
    try:
        path = form.format(**parts)
    except (KeyError, IndexError, ValueError, AttributeError) as error:
        raise RecordingError(f"{key} = {form!r} of meta/info.json is no pattern of paths ({error}).") from None
    if Path(path).is_absolute() or ".." in Path(path).parts:
        raise RecordingError(f"{key} = {form!r} of meta/info.json leads out of the dataset.")
    return path


@contextmanager
def _explain_errors(file: Path) -> Generator[None]:
    """Turns what the reader of parquet files raises into an error that names the file and the next step."""
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:  # The file is untrusted, and its readers raise any error.
        said = " ".join(str(error).split()).rstrip(".:") or type(error).__name__
        raise RecordingError(f"{file} is no parquet file that can be read ({said}); download it again.") from None


def _load() -> ModuleType:
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise PreflightError(
            f"LeRobot datasets need the package {error.name!r}; install it with `pip install 'dipac[lerobot]'`."
        ) from None
    return pyarrow.parquet
