"""Bags of ROS 2 are read as they were written, in both storages, and say what is wrong with them in one sentence."""

import contextlib
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import pytest

from app.core.errors import RecordingError, UsageError
from app.recording.exchange.foreign_file import is_foreign, open_foreign
from app.recording.exchange.ros2 import decode
from app.recording.exchange.streams.measured_episode import MeasuredEpisode
from app.recording.exchange.streams.stream_map import CameraStreams, StreamMap, ToolStreams
from tests.recording import bags
from tests.recording.bags import BagWriter, Event
from tests.recording.rope_scene import HEIGHT, WIDTH, K, RopeScene, camera_pose, poses

pytest.importorskip("rosbags", reason="The package `rosbags` is missing; install dipac[ros2].")
SCENE = RopeScene(pushes=1, step_s=0.05, image_s=0.5)


class Reading(Protocol):
    def __call__(self, path: Path, streams: StreamMap | None = None) -> tuple[StreamMap, MeasuredEpisode]: ...


@pytest.fixture
def read() -> Iterator[Reading]:
    """Reader of the mapping and the episode; the bags stay open as long as the test."""
    with ExitStack() as stack:

        def reading(path: Path, streams: StreamMap | None = None) -> tuple[StreamMap, MeasuredEpisode]:
            source = stack.enter_context(open_foreign(path))
            streams = streams or source.guess()
            return streams, source.episodes(streams)[0]

        yield reading


def with_depth() -> list[Event]:
    return [bags.static_camera(), *bags.tool_transforms(SCENE), *bags.images(SCENE)]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_poses_images_and_depth_are_those_that_were_written(
    read: Reading, storage: bags.Storage, tmp_path: Path
) -> None:
    path = BagWriter(storage=storage).write(tmp_path / "bag", with_depth())
    streams, episode = read(path)
    assert (streams.base, streams.tool.frame, streams.clock) == ("base_link", "tool0", "header")
    times, places = SCENE.tool()
    assert episode.command is None
    assert episode.state is not None
    assert episode.state.times_s == pytest.approx(times, abs=1e-6)
    assert episode.state.poses[:, :3] == pytest.approx(places, abs=1e-9)
    assert episode.moments_s == pytest.approx(SCENE.image_times(), abs=1e-6)
    assert episode.began_ns == bags.START_NS
    (frame,) = episode.look(float(episode.moments_s[3])).frames
    color, away = SCENE.images(float(SCENE.image_times()[3]))
    assert np.array_equal(frame.color, color)
    assert np.array_equal(frame.depth, np.round(1000 * away))
    assert frame.camera.depth_unit_m == 0.001
    assert np.allclose(frame.camera.K, K)
    assert frame.camera.T_world_camera == pytest.approx(camera_pose(), abs=1e-9)


def test_one_file_of_a_bag_is_a_bag(read: Reading, tmp_path: Path) -> None:
    folder = BagWriter().write(tmp_path / "bag", with_depth())
    (folder / "metadata.yaml").unlink()
    for path in (folder, folder / "bag.mcap"):
        assert is_foreign(path)
        assert len(read(path)[1].moments_s) == len(SCENE.image_times())


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_messages_that_are_compressed_one_by_one_are_read_with_metadata_and_without(
    read: Reading, storage: bags.Storage, tmp_path: Path
) -> None:
    folder = BagWriter(storage=storage, compress=True).write(tmp_path / "bag", with_depth())
    for path in (folder, next(it for it in folder.iterdir() if it.suffix in (".mcap", ".db3"))):
        _, episode = read(path)
        assert episode.tool.times_s == pytest.approx(SCENE.tool()[0], abs=1e-6)
        assert np.array_equal(episode.look(0.0).frames[0].color, SCENE.images(0.0)[0])


def test_types_may_be_named_without_their_kind(read: Reading, tmp_path: Path) -> None:
    events = [(it[0], it[1], it[2], it[3]) for it in with_depth()]
    folder = BagWriter(storage="sqlite3").write(tmp_path / "bag", events)
    with contextlib.closing(sqlite3.connect(next(folder.glob("*.db3")))) as base:
        base.execute("UPDATE topics SET type = replace(type, '/msg/', '/')")
        base.commit()
    (folder / "metadata.yaml").unlink()
    assert len(read(folder)[1].moments_s) == len(SCENE.image_times())


def test_compressed_images_and_depth_are_decoded(read: Reading, tmp_path: Path) -> None:
    events = [bags.static_camera(), *bags.tool_poses(SCENE), *bags.compressed_images(SCENE)]
    streams, episode = read(BagWriter().write(tmp_path / "bag", events))
    assert streams.cameras[0].depth.endswith("compressedDepth")
    (frame,) = episode.look(0.0).frames
    color, away = SCENE.images(0.0)
    assert np.abs(frame.color.astype(int) - color).mean() < 4
    assert np.array_equal(frame.depth, np.round(1000 * away))


def test_a_command_is_told_from_what_was_measured(read: Reading, tmp_path: Path) -> None:
    events = [bags.static_camera(), *bags.images(SCENE), *bags.tool_poses(SCENE)]
    events += bags.tool_poses(SCENE, bags.TARGET)
    streams, episode = read(BagWriter().write(tmp_path / "bag", events))
    assert (streams.tool.pose, streams.tool.command) == (bags.POSE, bags.TARGET)
    assert episode.state is not None
    assert episode.command is not None


def test_poses_in_another_frame_are_brought_into_that_of_the_base(read: Reading, tmp_path: Path) -> None:
    away = np.array([0.1, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
    moved = ("/tf_static", "tf2_msgs/msg/TFMessage", bags.transform(0.0, "base_link", "table", away))
    times, places = SCENE.tool()
    events: list[Event] = [(0.0, *moved), bags.static_camera(), *bags.images(SCENE)]
    for time_s, pose in zip(times.tolist(), poses(places - away[:3]), strict=True):
        message = bags.pose_stamped(time_s, "table", pose)
        events.append((time_s, bags.POSE, "geometry_msgs/msg/PoseStamped", message))
    _, episode = read(BagWriter().write(tmp_path / "bag", events))
    assert episode.tool.poses[:, :3] == pytest.approx(places, abs=1e-9)


def test_the_tip_is_ahead_of_the_flange_as_the_mapping_says(read: Reading, tmp_path: Path) -> None:
    path = BagWriter().write(tmp_path / "bag", with_depth())
    streams, _ = read(path)
    longer = StreamMap(
        base=streams.base, tool=ToolStreams(frame="tool0", tip_m=(0.0, 0.0, 0.05)), cameras=streams.cameras
    )
    _, episode = read(path, longer)
    assert episode.tool.poses[:, 2] == pytest.approx(SCENE.tool()[1][:, 2] - 0.05, abs=1e-9)


def test_depth_of_a_camera_beside_gets_the_colours_that_are_there(read: Reading, tmp_path: Path) -> None:
    beside, kind = np.array([0.02, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), "sensor_msgs/msg/Image"
    events = [bags.static_camera(), *bags.tool_transforms(SCENE), *bags.images(SCENE, depth=False)]
    message = bags.transform(0.0, bags.OPTICAL, "front_depth_optical_frame", beside)
    events.append((0.0, "/tf_static", "tf2_msgs/msg/TFMessage", message))
    for time_s in SCENE.image_times().tolist():
        # A flat table at 0.7 m: the depth camera 2 cm to the right sees the rope 2 cm to the left.
        _, away = SCENE.images(time_s)
        depth = np.roll(away, -round(0.02 * K[0, 0] / 0.69), axis=1)
        events.append(
            (
                time_s,
                "/front/depth/image_rect_raw",
                kind,
                bags.image(time_s, "front_depth_optical_frame", np.round(1000 * depth).astype(np.uint16), "16UC1"),
            )
        )
        events.append(
            (
                time_s,
                "/front/depth/camera_info",
                "sensor_msgs/msg/CameraInfo",
                bags.camera_info(time_s, "front_depth_optical_frame"),
            )
        )
    streams, episode = read(BagWriter().write(tmp_path / "bag", events))
    assert streams.cameras[0].depth_info == "/front/depth/camera_info"
    (frame,) = episode.look(0.0).frames
    assert frame.camera.T_world_camera[:3, 3] == pytest.approx([0.52, 0.0, 0.7])
    near = frame.depth < 693  # the rope's back is seen there
    assert near.sum() > 500
    rope = (frame.color[..., 0] > 200) & (frame.color[..., 2] < 50)
    assert (rope & near).sum() > 0.9 * near.sum()


def test_joint_states_and_a_description_place_the_tool(read: Reading, tmp_path: Path) -> None:
    description = """<robot name="r"><link name="base_link"/><link name="arm"/><link name="tip"/>
    <joint name="turn" type="revolute"><parent link="base_link"/><child link="arm"/>
      <origin xyz="0 0 0.1" rpy="0 0 0"/><axis xyz="0 0 1"/></joint>
    <joint name="reach" type="prismatic"><parent link="arm"/><child link="tip"/>
      <origin xyz="0.3 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/></joint></robot>"""
    events = [bags.static_camera(), *bags.images(SCENE)]
    events.append((0.0, "/robot_description", "std_msgs/msg/String", bags.text(description)))
    for index in range(40):
        state = bags.joint_state(0.1 * index, ["reach", "turn"], [0.01 * index, np.pi / 2])
        events.append((0.1 * index, "/joint_states", "sensor_msgs/msg/JointState", state))
    streams, episode = read(BagWriter().write(tmp_path / "bag", events))
    assert (streams.tool.joints, streams.tool.urdf) == ("/joint_states", "/robot_description")
    # Turned by 90 degrees, 0.3 m ahead along y; the slide, turned once more, goes along -x.
    assert episode.tool.poses[10, :3] == pytest.approx([-0.1, 0.3, 0.1], abs=1e-9)


def test_headers_of_two_clocks_are_seen_and_receipt_is_taken(tmp_path: Path) -> None:
    events = [bags.static_camera(), *bags.tool_poses(SCENE), *bags.images(SCENE, late_s=25.0)]
    path = BagWriter().write(tmp_path / "bag", events)
    with open_foreign(path) as source:
        assert "several clocks" in source.stream_list.notes[0]
        streams = source.guess()
        assert streams.clock == "receive"
        assert source.episodes(streams)[0].moments_s == pytest.approx(SCENE.image_times(), abs=1e-6)


def test_a_colour_camera_without_depth_is_taken_where_nothing_has_depth(read: Reading, tmp_path: Path) -> None:
    events = [bags.static_camera(), *bags.tool_poses(SCENE), *bags.images(SCENE, depth=False)]
    streams, episode = read(BagWriter().write(tmp_path / "bag", events))
    assert streams.cameras == (CameraStreams(name="front", color=bags.COLOR, info=bags.INFO),)
    assert not episode.look(0.0).frames[0].depth.any()


@pytest.mark.parametrize(
    ("encode", "encoding"),
    [
        (lambda rgb: rgb, "rgb8"),
        (lambda rgb: rgb[..., ::-1], "bgr8"),
        (lambda rgb: np.dstack([rgb, rgb[..., :1]]), "rgba8"),
        (lambda rgb: np.dstack([rgb[..., ::-1], rgb[..., :1]]), "bgra8"),
    ],
)
def test_every_order_of_colours_is_read(
    read: Reading, encode: Callable[[np.ndarray], np.ndarray], encoding: str
) -> None:
    color, _ = SCENE.images(0.0)
    assert np.array_equal(decode.colour_image(bags.image(0.0, "a", encode(color), encoding)), color)


@pytest.mark.parametrize("encoding", ["bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"])
def test_a_mosaic_is_that_of_its_name(encoding: str) -> None:
    even = np.full((16, 16, 3), (200, 100, 30), np.uint8)
    mosaic = np.zeros((16, 16), np.uint8)
    for index, colour in enumerate(encoding.removeprefix("bayer_")[:4]):
        mosaic[index // 2 :: 2, index % 2 :: 2] = even[0, 0, "rgb".index(colour)]
    found = decode.colour_image(bags.image(0.0, "a", mosaic, encoding))
    assert np.array_equal(found[4:12, 4:12], even[4:12, 4:12])


def test_depth_in_metres_becomes_millimetres_and_what_is_not_finite_no_reading() -> None:
    depth = np.array([[0.5, np.nan], [np.inf, -1.0]], np.float32)
    found, unit_m = decode.depth_image(bags.image(0.0, "a", depth, "32FC1"), 0.0)
    assert unit_m == 0.001
    assert found.tolist() == [[500, 0], [0, 0]]


def test_depth_that_a_transport_quantised_is_read_in_metres() -> None:
    quantised, (a, b) = np.array([[0, 400], [800, 1600]], np.uint16), (500.0, -100.0)
    head = b"\0\0\0\0" + np.array([a, b], "<f4").tobytes()
    png = cv2.imencode(".png", quantised)[1].tobytes()
    message = bags.compressed(0.0, "a", head + png, "32FC1; compressedDepth png")
    found, _ = decode.depth_image(message, 0.001)
    assert found.tolist() == [[0, 1000], [round(1000 * a / 900), round(1000 * a / 1700)]]


def test_a_cloud_keeps_its_finite_points_and_their_colours() -> None:
    points = np.array([[0.1, 0.2, 0.3], [np.nan, 0, 0], [1, 2, 3]], np.float32)
    colours = np.array([[10, 20, 30], [0, 0, 0], [250, 1, 128]], np.uint8)
    found = decode.cloud_points(bags.point_cloud(0.0, "a", points, colours))
    assert found.points == pytest.approx(points[[0, 2]])
    assert found.colours is not None
    assert found.colours.tolist() == colours[[0, 2]].tolist()


def cut(path: Path) -> Path:
    file = path / f"{path.name}.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    return path


def cut_sqlite(path: Path) -> Path:
    file = next(path.glob("*.db3"))
    file.write_bytes(file.read_bytes()[:5000])
    return path


def without_metadata(path: Path) -> Path:
    (path / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 9}\n")
    return path


def emptied(path: Path) -> Path:
    for file in path.glob("*.mcap"):
        file.write_bytes(b"")
    return path


@pytest.mark.parametrize(
    ("damage", "storage", "said"),
    [
        (cut, "mcap", "cut off or damaged.*mcap recover"),
        (emptied, "mcap", "cut off or damaged.*mcap recover"),
        (cut_sqlite, "sqlite3", "cut off or damaged.*sqlite3 FILE"),
        (without_metadata, "mcap", "no complete bag.*ros2 bag reindex"),
    ],
)
def test_a_damaged_bag_says_what_mends_it(
    read: Reading, damage: Callable[[Path], Path], storage: bags.Storage, said: str, tmp_path: Path
) -> None:
    path = damage(BagWriter(storage=storage).write(tmp_path / "bag", with_depth()))
    with pytest.raises(RecordingError, match=said):
        read(path)


def test_other_files_are_told_from_bags(read: Reading, tmp_path: Path) -> None:
    (tmp_path / "one.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(UsageError, match="rosbags-convert"):
        read(tmp_path / "one.bag")
    (tmp_path / "folder").mkdir()
    with pytest.raises(UsageError, match=r"metadata\.yaml.*meta/info\.json.*poses\.csv"):
        read(tmp_path / "folder")
    with pytest.raises(UsageError, match="Unknown file"):
        read(tmp_path / "none.mcap")


def info_of(model: str, **more: Any) -> list[Event]:
    kind = "sensor_msgs/msg/CameraInfo"
    return [
        (it[0], bags.INFO, kind, bags.camera_info(it[0], bags.OPTICAL, model=model, **more)) if it[2] == kind else it
        for it in with_depth()
    ]


BAD: list[tuple[str, Callable[[], list[Event]], str]] = [
    ("no messages", lambda: [(0.0, bags.COLOR, "sensor_msgs/msg/Image", None)], "nothing says where the tool was"),
    ("no tool", lambda: [bags.static_camera(), *bags.images(SCENE)], "nothing says where the tool was"),
    ("no images", lambda: [*bags.tool_poses(SCENE)], "nothing shows the object"),
    (
        "no tf",
        lambda: [*bags.tool_poses(SCENE), *bags.images(SCENE)],
        r"nothing says where camera 'front' is.*pose = \[",
    ),
    (
        "no info",
        lambda: [it for it in with_depth() if it[1] != bags.INFO],
        r"no CameraInfo.*intrinsics = \[fx, fy, cx, cy\]",
    ),
    (
        "unknown encoding",
        lambda: [
            bags.static_camera(),
            *bags.tool_transforms(SCENE),
            *bags.images(SCENE, color_of=lambda it: (it, "hsv16")),
        ],
        "encoding 'hsv16' is not read; republish",
    ),
    ("fisheye", lambda: info_of("equidistant", distortion=(0.1, 0.1, 0.1, 0.1)), "distortion model 'equidistant'"),
    (
        "cut image",
        lambda: [
            bags.static_camera(),
            *bags.tool_transforms(SCENE),
            *bags.images(SCENE, color_of=lambda it: (it[:, :, :2], "rgb8")),
        ],
        "bytes, and 320x240 pixels",
    ),
]


@pytest.mark.parametrize(("events", "said"), [it[1:] for it in BAD], ids=[it[0] for it in BAD])
def test_what_a_bag_lacks_is_said_with_the_next_step(
    read: Reading, events: Callable[[], list[Event]], said: str, tmp_path: Path
) -> None:
    path = BagWriter().write(tmp_path / "bag", events())

    def use() -> None:
        _, episode = read(path)
        episode.look(float(episode.moments_s[0]))

    with pytest.raises(RecordingError, match=said):
        use()


def test_a_topic_that_is_not_there_is_named_with_those_that_are(read: Reading, tmp_path: Path) -> None:
    path = BagWriter().write(tmp_path / "bag", with_depth())
    with pytest.raises(RecordingError, match=r"holds no '/gone'; it holds .*/front/color/image_raw"):
        read(path, StreamMap(tool=ToolStreams(pose="/gone")))


def test_images_of_a_distorting_lens_are_undistorted(read: Reading, tmp_path: Path) -> None:
    path = BagWriter().write(tmp_path / "bag", info_of("plumb_bob", distortion=(-0.3, 0.1, 0.0, 0.0, 0.0)))
    _, episode = read(path)
    (frame,) = episode.look(0.0).frames
    color, _ = SCENE.images(0.0)
    straight = cv2.undistort(color, K, np.array([-0.3, 0.1, 0, 0, 0]))
    assert frame.color.shape == (HEIGHT, WIDTH, 3)
    assert np.abs(frame.color.astype(int) - straight).mean() < 1


def test_counts_in_the_metadata_that_are_none_are_said(read: Reading, tmp_path: Path) -> None:
    folder = BagWriter().write(tmp_path / "bag", with_depth())
    file = folder / "metadata.yaml"
    file.write_text(re.sub(r"message_count: \d+", "message_count: many", file.read_text()))
    with pytest.raises(RecordingError, match=r"cannot be read as a bag|no complete bag"):
        read(folder)
