"""LeRobot datasets of a rope that is pushed, as LeRobot writes them: images in parquet, or videos."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import PIL.Image

from tests.recording.rope_scene import RopeScene, poses

COLOR, DEPTH = "observation.images.front", "observation.images.front_depth"
FPS = 10
STATE = ["x", "y", "z", "qw", "qx", "qy", "qz", "gripper.pos"]
QUANTISED: Mapping[str, Any] = {
    "video.depth_min": 0.1,
    "video.depth_max": 2.0,
    "video.shift": 3.5,
    "video.use_log": True,
}


def feature(dtype: str, shape: list[int], names: Any = None, **info: Any) -> dict[str, Any]:
    return {"dtype": dtype, "shape": shape, "names": names, **({"info": info} if info else {})}


def write_dataset(
    root: Path, scene: RopeScene, *, episodes: int = 2, video: bool = False, depth: bool = True, version: str = "v3.0"
) -> Path:
    """A dataset whose episodes are the same pushes."""
    import pyarrow
    import pyarrow.parquet

    times, places = scene.tool()
    steps = np.arange(0.0, times[-1], 1 / FPS)
    state = np.column_stack([np.interp(steps, times, column) for column in poses(places).T])
    state = np.column_stack([state, np.zeros(len(steps))]).astype(np.float32)
    seen = [scene.images(time_s) for time_s in steps.tolist()]
    kind = "video" if video else "image"
    features = {
        "observation.state": feature("float32", [8], STATE),
        "action": feature("float32", [8], STATE),
        COLOR: feature(kind, [240, 320, 3]),
        "timestamp": feature("float32", [1]),
        "episode_index": feature("int64", [1]),
    }
    if depth:
        info = QUANTISED if video else {"depth_unit": "mm"}
        features[DEPTH] = feature(kind, [240, 320, 1], is_depth_map=True, **info)
    count = len(steps)
    columns: dict[str, Any] = {
        "observation.state": np.tile(state, (episodes, 1)).tolist(),
        "action": np.tile(state, (episodes, 1)).tolist(),
        "timestamp": np.tile(steps, episodes).astype(np.float32).tolist(),
        "episode_index": np.repeat(np.arange(episodes), count).tolist(),
    }
    if not video:
        columns[COLOR] = [{"bytes": png(color), "path": None} for color, _ in seen] * episodes
        if depth:
            columns[DEPTH] = [{"bytes": tiff(away), "path": None} for _, away in seen] * episodes
    data = root / "data" / "chunk-000" / "file-000.parquet"
    data.parent.mkdir(parents=True)
    pyarrow.parquet.write_table(pyarrow.table(columns), data, row_group_size=count)
    names = [COLOR, *([DEPTH] if depth else [])]
    rows = [
        {
            "episode_index": number,
            "length": count,
            "data/chunk_index": 0,
            "data/file_index": 0,
            **{
                f"videos/{name}/{key}": value
                for name in (names if video else [])
                for key, value in (("chunk_index", 0), ("file_index", 0), ("from_timestamp", number * count / FPS))
            },
        }
        for number in range(episodes)
    ]
    listed = root / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    listed.parent.mkdir(parents=True)
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), listed)
    if video:
        write_video(video_path(root, COLOR), [color for color, _ in seen] * episodes, "rgb24")
        if depth:
            write_video(video_path(root, DEPTH), [quantised(away) for _, away in seen] * episodes, "gray12le")
    told = {
        "codebase_version": version,
        "robot_type": "arm",
        "fps": FPS,
        "total_episodes": episodes,
        "total_frames": episodes * count,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4" if video else None,
        "features": features,
    }
    (root / "meta" / "info.json").write_text(json.dumps(told))
    return root


def video_path(root: Path, name: str) -> Path:
    return root / "videos" / name / "chunk-000" / "file-000.mp4"


def png(color: np.ndarray) -> bytes:
    return cv2.imencode(".png", color[..., ::-1])[1].tobytes()


def tiff(away_m: np.ndarray) -> bytes:
    stream = io.BytesIO()
    PIL.Image.fromarray(np.round(1000 * away_m).astype(np.uint16)).save(stream, "TIFF")
    return stream.getvalue()


def quantised(away_m: np.ndarray) -> np.ndarray:
    """LeRobot's own 12 bits of depth."""
    low, high, shift = (QUANTISED[f"video.{name}"] for name in ("depth_min", "depth_max", "shift"))
    share = (np.log(away_m + shift) - np.log(low + shift)) / (np.log(high + shift) - np.log(low + shift))
    return np.rint(share * 4095).clip(0, 4095).astype(np.uint16)


def write_video(path: Path, images: list[np.ndarray], form: str) -> None:
    """A video without loss, as far as the codec has none."""
    import av

    path.parent.mkdir(parents=True)
    with av.open(str(path), "w") as container:
        deep = form != "rgb24"
        stream = container.add_stream("libx265" if deep else "libx264", rate=FPS)
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = "gray12le" if deep else "yuv444p"
        stream.options = {"x265-params": "lossless=1:log-level=none", "g": "2"} if deep else {"crf": "1", "g": "2"}
        for pixels in images:
            for packet in stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format=form)):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
