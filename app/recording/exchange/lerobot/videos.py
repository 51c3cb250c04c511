"""Videos of a LeRobot dataset: the image next to a time, in colours or as depth.

Depth is quantised to 12 bits as LeRobot does (`lerobot.datasets.depth_utils.quantize_depth`): linearly in the depth d,
or in log(d + shift), from `depth_min` to `depth_max`.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final, final

import numpy as np
from jaxtyping import Float64, UInt16

from app.core.errors import PreflightError, RecordingError
from app.core.types import ColourImage
from app.recording.exchange.lerobot.rows import VideoPlace, path_of

_PATH: Final = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_MOST: Final = (1 << 12) - 1
_MIN_M, _MAX_M, _SHIFT_M, _LOG = 0.01, 10.0, 3.5, True
"""LeRobot's own defaults of the range and of the scale."""


@final
class Videos:
    """Video files of the dataset at `path`. Raises RecordingError, naming the file, where one cannot be decoded."""

    def __init__(self, path: Path, info: Mapping[str, Any]) -> None:
        self._path, self._info = path, info

    def color(self, name: str, place: VideoPlace, time_s: float) -> ColourImage:
        """The image next to a time of the episode."""
        return self._image(name, place, time_s, "rgb24")

    def depth_m(self, name: str, place: VideoPlace, time_s: float) -> Float64[np.ndarray, "height width"]:
        """Depth [m] next to a time of the episode; 0 where it is nearer than it can tell."""
        steps: UInt16[np.ndarray, "height width"] = self._image(name, place, time_s, "gray12le")
        return metres_of(steps, self._info["features"][name].get("info") or {})

    def _image(self, name: str, place: VideoPlace, time_s: float, form: str) -> Any:
        file = self._path / path_of(
            self._info, "video_path", _PATH, video_key=name, chunk_index=place.chunk, file_index=place.file
        )
        if not file.is_file():
            raise RecordingError(
                f"{file} is not there; download the dataset with its videos, or leave the camera out of the file of "
                "--topics."
            )
        av, wanted_s = _load(), place.from_s + time_s
        try:
            with av.open(str(file)) as container:
                stream = container.streams.video[0]
                container.seek(round(wanted_s / stream.time_base), stream=stream, backward=True)
                nearest, apart_s = None, math.inf
                for frame in container.decode(stream):
                    away_s = abs(float(frame.pts * stream.time_base) - wanted_s)
                    if away_s > apart_s:
                        break
                    nearest, apart_s = frame, away_s
                if nearest is None:
                    raise ValueError("it holds no image")
                return nearest.to_ndarray(format=form)
        except Exception as error:  # The file is untrusted, and its decoders raise any error.
            said = " ".join(str(error).split()) or type(error).__name__
            raise RecordingError(f"{file} cannot be decoded at {wanted_s:.3f} s ({said}); download it again.") from None


def metres_of(steps: np.ndarray, info: Mapping[str, Any]) -> Float64[np.ndarray, "height width"]:
    """Depth [m] of quantised steps; 0 at the lowest step, which stands for no reading, too."""
    low, high, shift = (
        _number(info, name, own) for name, own in (("depth_min", _MIN_M), ("depth_max", _MAX_M), ("shift", _SHIFT_M))
    )
    share = steps.astype(np.float64) / _MOST
    if bool(info.get("video.use_log", info.get("use_log", _LOG))):
        a, b = math.log(low + shift), math.log(high + shift)
        depth = np.exp(a + share * (b - a)) - shift
    else:
        depth = low + share * (high - low)
    return np.where(steps > 0, depth, 0.0)


def _number(info: Mapping[str, Any], name: str, own: float) -> float:
    value = info.get(f"video.{name}", info.get(name, own))
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else own


def _load() -> ModuleType:
    try:
        import av
    except ImportError as error:
        raise PreflightError(
            f"Videos of LeRobot datasets need the package {error.name!r}: `pip install 'dipac[lerobot]'`."
        ) from None
    return av
