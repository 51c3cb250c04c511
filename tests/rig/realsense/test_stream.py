"""Images through the SDK's own pipeline, from recordings that its own recorder made of rendered views."""

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.core.errors import DeviceError, RecordingError
from app.rig.realsense.sdk.device_enumeration import census
from app.rig.realsense.sdk.sdk import Opening, Sdk, load_realsense
from app.rig.realsense.sdk.software import CameraDescription, SoftwareCamera
from app.rig.realsense.sdk.sources import CameraAbsent, Live, RecordedSource
from app.rig.realsense.sdk.synthetic import ImagerPair, record
from app.rig.realsense.settings import Filters, StreamSettings
from app.rig.realsense.stream import AlignedImages, Stream, StreamEnded, streaming
from tests.rig.realsense.bodies import BOX_M, HEIGHT, PLANE_M, RATE_HZ, UNIT_M, WIDTH, Scene, aside, imager, together

SETTINGS = StreamSettings(width=WIDTH, height=HEIGHT, rate_hz=RATE_HZ, warm_up=0)
HOLE = (slice(30, 45), slice(22, 42))
EVERYTHING = Filters(near_m=0.2, far_m=2.0, spatial=True, temporal=True)
rs = load_realsense()


# The SDK plays a recording at the pace of its camera and leaves out what comes too late for that.
pytestmark = pytest.mark.serial


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A recording of each kind of scene, by its name."""
    folder = tmp_path_factory.mktemp("recordings")
    whole, holed = Scene(body=together()), Scene(body=together(), hole=HOLE)
    start_s = time.time() - 1000
    scenes: dict[str, tuple[CameraDescription, Iterator[ImagerPair]]] = {
        "aside": (aside(), Scene(body=aside()).views(10, start_s=start_s)),
        "holed later": (together(), _then(whole, holed, start_s)),
        "other": (together("4567"), whole.views(3, start_s=start_s)),
    }
    for name, (body, views) in scenes.items():
        record(folder / f"{name}.db3", body, views)
    return {name: folder / f"{name}.db3" for name in scenes}


def _then(first: Scene, then: Scene, start_s: float) -> Iterator[ImagerPair]:
    yield from first.views(8, start_s=start_s)
    yield from then.views(8, start_s=start_s + 8 / RATE_HZ)


@dataclass(frozen=True)
class InProcess:
    """A software camera of this process as a source."""

    camera: SoftwareCamera
    serial: str = "0123"

    def attach(self, opening: Opening, /) -> AbstractContextManager[None]:
        opening.pipeline.set_device(self.camera.device)
        return nullcontext()

    def reset(self, _: Sdk, /) -> None:
        raise DeviceError("a software camera cannot be reset")


def played(file: Path, settings: StreamSettings = SETTINGS) -> tuple[Stream, list[AlignedImages]]:
    """The stream, and what came until the recording's end."""
    with streaming(Sdk.load(), RecordedSource(file=file), settings) as stream:
        return stream, list(_shots(stream))


def _shots(stream: Stream) -> Iterator[AlignedImages]:
    while True:
        try:
            shot = stream.next()
        except StreamEnded:
            return
        if shot is not None:
            yield shot


def test_what_the_camera_says_of_itself_is_kept_by_a_recording(recordings: dict[str, Path]) -> None:
    stream, shots = played(recordings["aside"])
    assert (stream.opened.listed.serial, stream.opened.listed.usb) == ("0123", "3.2")
    assert stream.opened.warning == ""
    assert np.isclose(stream.opened.depth_unit_m, UNIT_M)
    assert np.allclose(stream.opened.K, aside().color.K, rtol=1e-6)
    assert len(shots) >= 5


def test_depth_is_where_the_colour_imager_sees_it_to_a_pixel(recordings: dict[str, Path]) -> None:
    _, shots = played(recordings["aside"])
    depth, corners = shots[-1].depth, Scene(body=aside()).corners_in_color()
    box = np.isclose(depth * UNIT_M, BOX_M, atol=0.006)
    rows, columns = np.nonzero(box)
    assert abs(columns.min() - corners[:2, 0].mean()) < 1.0
    assert abs(columns.max() - corners[2:, 0].mean()) < 1.0
    assert abs(rows.min() - corners[[0, 2], 1].mean()) < 1.0
    assert abs(rows.max() - corners[[1, 3], 1].mean()) < 1.0
    behind = depth[(depth > 0) & ~box] * UNIT_M
    assert np.all(np.abs(behind - PLANE_M) < 0.02), "nothing lies between the box and the plane"


def test_stamps_grow_with_the_camera_s_rate_and_are_of_the_middle_of_the_exposure(recordings: dict[str, Path]) -> None:
    _, shots = played(recordings["aside"])
    stamps = np.array([shot.stamp_s for shot in shots])
    steps = np.diff(stamps) * RATE_HZ
    assert np.all(steps > 0.5)
    assert np.allclose(steps, np.round(steps), atol=1e-3)
    numbers = np.array([int(shot.color[0, 0, 0]) for shot in shots])
    assert np.allclose(stamps - numbers / RATE_HZ, stamps[0] - numbers[0] / RATE_HZ, atol=1e-4)
    assert {shot.domain for shot in shots} == {"global"}


@pytest.mark.parametrize("filters", [Filters(), EVERYTHING], ids=["no filter", "every filter"])
def test_missing_depth_stays_missing(recordings: dict[str, Path], filters: Filters) -> None:
    """Also where images before had a reading, which the SDK's temporal filter would put there by itself."""
    settings = StreamSettings(width=WIDTH, height=HEIGHT, rate_hz=RATE_HZ, warm_up=0, filters=filters)
    _, shots = played(recordings["holed later"], settings)
    inside = Scene(body=together(), hole=HOLE).hole_in_color()
    assert shots[0].depth[inside].min() > 0
    assert int(shots[-1].color[0, 0, 0]) == 7, "the last view has come"
    assert shots[-1].depth[inside].size > 100
    assert not shots[-1].depth[inside].any()


def test_depth_out_of_the_limits_is_dropped(recordings: dict[str, Path]) -> None:
    near = StreamSettings(width=WIDTH, height=HEIGHT, rate_hz=RATE_HZ, warm_up=0, filters=Filters(far_m=0.6))
    _, shots = played(recordings["holed later"], near)
    assert 0 < shots[0].depth.max() * UNIT_M < 0.6


def test_the_first_images_are_dropped_while_the_camera_warms_up(recordings: dict[str, Path]) -> None:
    warm = StreamSettings(width=WIDTH, height=HEIGHT, rate_hz=RATE_HZ, warm_up=4)
    _, shots = played(recordings["aside"], warm)
    assert int(shots[0].color[0, 0, 0]) >= 4


def test_a_lens_is_made_a_pinhole(tmp_path: Path) -> None:
    """A dot where the lens has a ray is, rectified, where the pinhole has it; depth is never mixed."""
    lens = imager(150.0, distortion=(0.15, -0.05, 0.002, -0.001, 0.0))
    body = CameraDescription(serial="0123", depth=lens, color=lens, depth_unit_m=UNIT_M)
    bent = rs.intrinsics()
    bent.width, bent.height, bent.model = WIDTH, HEIGHT, rs.distortion.inverse_brown_conrady
    bent.fx, bent.fy, bent.ppx, bent.ppy = lens.K[0, 0], lens.K[1, 1], lens.K[0, 2], lens.K[1, 2]
    bent.coeffs = list(lens.distortion)
    pinhole = (20, 15)
    ray = np.linalg.inv(lens.K) @ [*pinhole, 1.0]
    seen_at = np.round(rs.rs2_project_point_to_pixel(bent, ray.tolist())).astype(int)
    assert np.linalg.norm(seen_at - pinhole) > 1.5, "the lens bends enough for the test"
    color, depth = np.zeros((HEIGHT, WIDTH, 3), np.uint8), Scene(body=body).depth()
    cv2.circle(color, tuple(seen_at.tolist()), 1, (255, 255, 255), -1)
    start_s = time.time()
    views = (ImagerPair(color=color, depth=depth, stamp_s=start_s + number / RATE_HZ) for number in range(4))
    record(tmp_path / "lens.db3", body, views)
    stream, shots = played(tmp_path / "lens.db3")
    v, u = np.nonzero(shots[-1].color[..., 0] > 128)
    assert np.hypot(u.mean() - pinhole[0], v.mean() - pinhole[1]) < 1.0
    assert np.allclose(stream.opened.K, lens.K, rtol=1e-6)
    assert set(np.unique(shots[-1].depth)) <= {0, round(PLANE_M / UNIT_M), round(BOX_M / UNIT_M)}


def test_a_camera_is_found_by_its_serial_number_among_others(recordings: dict[str, Path]) -> None:
    """Recorded cameras that the SDK's context was given stand on its list like those on the bus."""
    sdk = Sdk.load()
    loaded = [sdk.context.load_device(str(recordings[name])) for name in ("aside", "other")]
    with streaming(sdk, Live(serial="4567"), SETTINGS) as stream:
        assert stream.opened.listed.serial == "4567"
    with pytest.raises(CameraAbsent, match=r"'9999': there are 0123, 4567\. Check"):
        Live(serial="9999").attach(Opening.of(sdk))
    assert len(loaded) == 2


@pytest.mark.slow
def test_a_recording_may_be_left_before_its_end_as_often_as_one_likes(recordings: dict[str, Path]) -> None:
    """In a process of its own, which a corrupted heap would end."""
    leaving = multiprocessing.get_context("spawn").Process(target=_left, args=(recordings["other"], 300))
    leaving.start()
    leaving.join()
    assert leaving.exitcode == 0


def _left(file: Path, times: int) -> None:
    for _ in range(times):
        sdk = Sdk.load()
        listed = sdk.context.load_device(str(file))
        with streaming(sdk, Live(serial="4567"), SETTINGS):
            assert listed is not None


def test_a_camera_that_can_is_told_to_keep_global_time() -> None:
    sdk = Sdk.load()
    source = InProcess(camera=SoftwareCamera(sdk.rs, together()))
    sensors = source.camera.device.query_sensors()
    option = sdk.rs.option.global_time_enabled
    assert [sensor.get_option(option) for sensor in sensors] == [0, 0]
    with streaming(sdk, source, SETTINGS):
        assert [sensor.get_option(option) for sensor in sensors] == [1, 1]


def test_a_slow_port_is_noticed_and_said(tmp_path: Path) -> None:
    record(tmp_path / "slow.db3", replace(together(), usb="2.1"), Scene(body=together()).views(4))
    stream, _ = played(tmp_path / "slow.db3")
    assert "Software camera 0123 is connected by USB 2.1" in stream.opened.warning
    sdk = Sdk.load()
    loaded = sdk.context.load_device(str(tmp_path / "slow.db3"))
    said = census(sdk)
    assert said["cameras"] == ["Software camera 0123, USB 2.1"]
    assert said["warnings"] == [stream.opened.warning]
    assert loaded is not None


def test_a_size_that_the_camera_lacks_is_refused_in_words(recordings: dict[str, Path]) -> None:
    with (
        pytest.raises(DeviceError, match="does not stream 640x480 at 30 Hz"),
        streaming(Sdk.load(), RecordedSource(file=recordings["other"]), StreamSettings()),
    ):
        pass


def test_a_recording_that_is_not_there_is_an_absent_camera(tmp_path: Path) -> None:
    with (
        pytest.raises(CameraAbsent, match="no recording"),
        streaming(Sdk.load(), RecordedSource(file=tmp_path / "none.db3"), SETTINGS),
    ):
        pass


def test_a_recording_is_neither_misnamed_nor_overwritten(recordings: dict[str, Path], tmp_path: Path) -> None:
    for file, said in ((tmp_path / "a.bag", "must end in"), (recordings["other"], "is there already")):
        with pytest.raises(RecordingError, match=said):
            record(file, together(), Scene(body=together()).views(1))
