"""Camera stream: aligned pairs of images through the SDK's pipeline. The same for every source."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any, final

import numpy as np

from app.core.errors import DeviceError
from app.core.types import ColourImage, DepthImage, Intrinsics
from app.rig.realsense.sdk.device_enumeration import Listed, describe, warning
from app.rig.realsense.sdk.rectify import Rectifier
from app.rig.realsense.sdk.sdk import Opening, Sdk
from app.rig.realsense.sdk.sources import Source
from app.rig.realsense.sdk.timestamping import ClockReading, Domain
from app.rig.realsense.settings import Filters, StreamSettings

_AT_ONCE_MS = 200
"""Longest blocking call of the SDK [ms], so that the process can send heartbeats and take commands."""
_FARTHEST_M = 16.0
"""The longest distance that the SDK's threshold takes."""
_DOMAINS: Mapping[str, Domain] = {"global_time": "global", "system_time": "system", "hardware_clock": "hardware"}


class StreamEnded(DeviceError):
    """A recording has been played to its end."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class AlignedImages:
    """A received pair of images: `depth` aligned to `color`, both those of a pinhole camera.

    `stamp_s`: the middle of the exposure by the camera's clock [s], where it reports that, else the read-out.
    """

    color: ColourImage
    depth: DepthImage
    stamp_s: float
    domain: Domain
    arrival: ClockReading


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class OpenedCamera:
    """Description of an opened camera; `K` [pixel] is that of the colour image."""

    listed: Listed
    K: Intrinsics
    depth_unit_m: float
    warning: str


@final
class Stream:
    """Reader of a started pipeline."""

    def __init__(self, rs: ModuleType, pipeline: Any, profile: Any, settings: StreamSettings) -> None:
        self._rs, self._pipeline = rs, pipeline
        self._device = profile.get_device()
        _keep_global_time(rs, self._device)
        intrinsics = profile.get_stream(rs.stream.color).as_video_stream_profile().get_intrinsics()
        self._rectifier = Rectifier(rs, intrinsics)
        self._filters = [*_filters(rs, settings.filters), rs.align(rs.stream.color)]
        self._to_drop = settings.warm_up
        listed = describe(rs, self._device)
        self.opened = OpenedCamera(
            listed=listed,
            K=self._rectifier.K,
            depth_unit_m=float(self._device.first_depth_sensor().get_depth_scale()),
            warning=warning(listed),
        )

    def next(self) -> AlignedImages | None:
        """The next pair; None where none comes soon, or it is one of the first, which are dropped.

        Raises StreamEnded at the end of a recording, and DeviceError where the camera failed.
        """
        try:
            there, frames = self._pipeline.try_wait_for_frames(_AT_ONCE_MS)
            arrival = ClockReading.now()
            if there and self._to_drop == 0:
                return self._shot(frames, arrival)
            ended = not there and self._has_ended()
        except RuntimeError as error:
            raise DeviceError(f"The camera failed: {error}.") from error
        if ended:
            raise StreamEnded("the recording has been played")
        self._to_drop = max(self._to_drop - there, 0)
        return None

    def _shot(self, frames: Any, arrival: ClockReading) -> AlignedImages | None:
        for each in self._filters:
            frames = each.process(frames).as_frameset()
        depth, color = frames.get_depth_frame(), frames.get_color_frame()
        if not depth or not color:
            return None
        return AlignedImages(
            color=self._rectifier.color(np.asanyarray(color.get_data())),
            depth=self._rectifier.depth(np.asanyarray(depth.get_data())),
            stamp_s=_exposed_ms(self._rs, depth) / 1000,
            domain=_DOMAINS[depth.get_frame_timestamp_domain().name],
            arrival=arrival,
        )

    def _has_ended(self) -> bool:
        stopped = self._rs.playback_status.stopped
        return bool(self._device.is_playback() and self._device.as_playback().current_status() == stopped)


@contextmanager
def streaming(sdk: Sdk, source: Source, settings: StreamSettings) -> Generator[Stream]:
    """The camera, streaming until the block is left.

    Raises CameraAbsent where there is no such camera, and DeviceError where it cannot stream with these settings, or
    stop.
    """
    rs, opening = sdk.rs, Opening.of(sdk)
    with source.attach(opening):
        for stream, form in ((rs.stream.depth, rs.format.z16), (rs.stream.color, rs.format.rgb8)):
            opening.config.enable_stream(stream, settings.width, settings.height, form, settings.rate_hz)
        try:
            profile = opening.pipeline.start(opening.config)
        except RuntimeError as error:
            raise DeviceError(
                f"Camera {source.serial!r} does not stream {settings.width}x{settings.height} at "
                f"{settings.rate_hz} Hz: {error}. Ask for a size and rate that it has; a USB 2 port carries fewer."
            ) from error
        device = profile.get_device()
        try:
            if device.is_playback():
                device.as_playback().resume()
            yield Stream(rs, opening.pipeline, profile, settings)
        finally:
            _stop(opening.pipeline, device)


def _stop(pipeline: Any, device: Any) -> None:
    """Stop the pipeline, after pausing a recording.

    An unpaused one goes on being read into freed memory: one stop in 75 to 1000 corrupted the heap (pyrealsense2 2.59),
    none of 4500 after a pause. A later stream from the same device resumes it.
    """
    try:
        if device.is_playback():
            device.as_playback().pause()
        pipeline.stop()
    except RuntimeError as error:
        raise DeviceError(f"The camera's stream did not stop: {error}.") from error


def _keep_global_time(rs: ModuleType, device: Any) -> None:
    """Enable the SDK's global time where a sensor has it and accepts the option; recorded ones do not."""
    option = rs.option.global_time_enabled
    for sensor in device.query_sensors():
        if sensor.supports(option) and not sensor.is_option_read_only(option):
            sensor.set_option(option, 1.0)


def _exposed_ms(rs: ModuleType, frame: Any) -> float:
    """The frame's time stamp [ms], moved from its read-out to the middle of its exposure where the camera reports both.

    The two are microseconds of the device's clock (rs_frame.h: FRAME_TIMESTAMP, SENSOR_TIMESTAMP).
    """
    read_out, exposed = rs.frame_metadata_value.frame_timestamp, rs.frame_metadata_value.sensor_timestamp
    if not (frame.supports_frame_metadata(read_out) and frame.supports_frame_metadata(exposed)):
        return float(frame.get_timestamp())
    since_us = frame.get_frame_metadata(read_out) - frame.get_frame_metadata(exposed)
    return float(frame.get_timestamp()) - since_us / 1000


def _filters(rs: ModuleType, asked: Filters) -> list[Any]:
    """The SDK's filters in the order it recommends: limits, then smoothing in disparity, where noise is even.

    The temporal filter comes with its memory of missing readings enabled; it is disabled here.
    """
    chain = list[Any]()
    if asked.near_m is not None or asked.far_m is not None:
        chain.append(rs.threshold_filter(asked.near_m or 0.0, _FARTHEST_M if asked.far_m is None else asked.far_m))
    smoothing = list[Any]()
    if asked.spatial:
        smoothing.append(rs.spatial_filter())
    if asked.temporal:
        smoothing.append(rs.temporal_filter())
    for each in smoothing:
        each.set_option(rs.option.holes_fill, 0)
    if smoothing:
        chain += [rs.disparity_transform(True), *smoothing, rs.disparity_transform(False)]
    return chain
