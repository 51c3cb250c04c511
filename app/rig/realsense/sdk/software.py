"""Software camera of the SDK that shows given images: for recordings and rehearsals without hardware.

Its frames pass through the SDK like a real camera's: sensors, syncer, pipeline, alignment.
"""

from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any, Self, final

import numpy as np

from app.core.geometry.camera import CameraModel
from app.core.types import ColourImage, DepthImage, Intrinsics, Transform

_USB = "3.2"
_ASIDE_M, _NARROWER = 0.015, 0.72
_DEPTH_ID, _COLOUR_ID = 1, 2


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Imager:
    """One of the two imagers: its size [pixel], its pinhole matrix, and the SDK's five coefficients of distortion.

    These are of the kind that colour imagers of the D400 series report (inverse Brown-Conrady).
    """

    width: int
    height: int
    K: Intrinsics
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class CameraDescription:
    """Description of a camera for the SDK. `T_color_depth` [m] maps from the depth imager's frame to the colour's.

    `baseline_m`: of the stereo pair behind the depth, as in a D435 (0.050). `read_out_s`: time from the middle of the
    exposure to the image's stamp, which is that of its read-out.
    """

    serial: str
    depth: Imager
    color: Imager
    depth_unit_m: float
    T_color_depth: Transform = field(default_factory=lambda: np.eye(4))
    rate_hz: int = 30
    usb: str = _USB
    baseline_m: float = 0.050
    read_out_s: float = 0.008

    @classmethod
    def like_d435(cls, model: CameraModel, serial: str, *, rate_hz: int = 30) -> Self:
        """A camera with the colour image of `model`, and a depth imager beside it with a wider lens.

        About as a D435's: a good centimetre aside, and wider by tan(87/2) / tan(69/2), its nominal angles of view in
        degrees.
        """
        wide = np.diag([_NARROWER, _NARROWER, 1.0])
        middle = np.array([model.width - 1, model.height - 1]) / 2
        K = wide @ model.K
        K[:2, 2] = middle
        aside = np.eye(4)
        aside[0, 3] = _ASIDE_M
        return cls(
            serial=serial,
            depth=Imager(width=model.width, height=model.height, K=K),
            color=Imager(width=model.width, height=model.height, K=model.K),
            depth_unit_m=model.depth_unit_m,
            T_color_depth=aside,
            rate_hz=rate_hz,
        )

    def depth_view(self, model: CameraModel) -> CameraModel:
        """Model of the depth imager for the colour imager `model`: the view to render its depth with."""
        imager = self.depth
        return replace(
            model,
            width=imager.width,
            height=imager.height,
            K=imager.K,
            T_world_camera=model.T_world_camera @ self.T_color_depth,
        )


@final
class SoftwareCamera:
    """Software camera; `device` is the SDK's handle, and shows the images given to `show`."""

    def __init__(self, rs: ModuleType, body: CameraDescription) -> None:
        self.device: Any = rs.software_device()
        self._rs, self._body, self._shown = rs, body, 0
        self._inform()
        self._depth: Any = self.device.add_sensor("Stereo Module")
        self._color: Any = self.device.add_sensor("RGB Camera")
        self._depth.add_read_only_option(rs.option.depth_units, body.depth_unit_m)
        self._depth.add_read_only_option(rs.option.stereo_baseline, body.baseline_m * 1000)
        for sensor in (self._depth, self._color):
            sensor.add_option(rs.option.global_time_enabled, _switch(rs), True)
        self._depth_profile = self._stream(self._depth, body.depth, rs.stream.depth, rs.format.z16, _DEPTH_ID)
        self._color_profile = self._stream(self._color, body.color, rs.stream.color, rs.format.rgb8, _COLOUR_ID)
        self._depth_profile.register_extrinsics_to(self._color_profile, self._extrinsics())
        self.device.create_matcher(rs.matchers.dlr_c)

    def show(self, color: ColourImage, depth: DepthImage, *, stamp_s: float) -> None:
        """Show a pair of images, of the sizes of the imagers, exposed at `stamp_s` [s] of the calendar."""
        self._shown += 1
        stamp_s += self._body.read_out_s
        self._send_frame(self._depth, self._depth_profile, depth, stamp_s)
        self._send_frame(self._color, self._color_profile, color, stamp_s)

    def _inform(self) -> None:
        info = self._rs.camera_info
        for what, said in (
            (info.name, "Software camera"),
            (info.serial_number, self._body.serial),
            (info.usb_type_descriptor, self._body.usb),
            (info.firmware_version, "none"),
        ):
            self.device.register_info(what, said)

    def _stream(self, sensor: Any, imager: Imager, kind: Any, form: Any, identity: int) -> Any:
        stream = self._rs.video_stream()
        stream.type, stream.fmt, stream.index, stream.uid = kind, form, 0, identity
        stream.width, stream.height, stream.fps = imager.width, imager.height, self._body.rate_hz
        stream.bpp = 2 if form == self._rs.format.z16 else 3
        stream.intrinsics = self._intrinsics(imager)
        return sensor.add_video_stream(stream, True).as_video_stream_profile()

    def _intrinsics(self, imager: Imager) -> Any:
        intrinsics = self._rs.intrinsics()
        intrinsics.width, intrinsics.height = imager.width, imager.height
        intrinsics.fx, intrinsics.fy = float(imager.K[0, 0]), float(imager.K[1, 1])
        intrinsics.ppx, intrinsics.ppy = float(imager.K[0, 2]), float(imager.K[1, 2])
        bent = any(imager.distortion)
        intrinsics.model = self._rs.distortion.inverse_brown_conrady if bent else self._rs.distortion.none
        intrinsics.coeffs = list(imager.distortion)
        return intrinsics

    def _extrinsics(self) -> Any:
        extrinsics, pose = self._rs.extrinsics(), self._body.T_color_depth
        extrinsics.rotation = pose[:3, :3].ravel(order="F").tolist()
        extrinsics.translation = pose[:3, 3].tolist()
        return extrinsics

    def _send_frame(self, sensor: Any, profile: Any, image: np.ndarray, stamp_s: float) -> None:
        frame = self._rs.software_video_frame()
        frame.pixels = np.ascontiguousarray(image)
        frame.bpp = image.dtype.itemsize * (image.shape[2] if image.ndim == 3 else 1)
        frame.stride = frame.bpp * image.shape[1]
        frame.timestamp, frame.domain = stamp_s * 1000, self._rs.timestamp_domain.global_time
        frame.frame_number, frame.profile = self._shown, profile
        frame.depth_units = self._body.depth_unit_m
        value, exposed_s = self._rs.frame_metadata_value, stamp_s - self._body.read_out_s
        sensor.set_metadata(value.frame_timestamp, round(stamp_s * 1e6))
        sensor.set_metadata(value.sensor_timestamp, round(exposed_s * 1e6))
        sensor.on_video_frame(frame)


def _switch(rs: ModuleType) -> Any:
    """The range of a switch option, off at first."""
    switch = rs.option_range()
    switch.min, switch.max, switch.step, switch.default = 0.0, 1.0, 1.0, 0.0
    return switch
