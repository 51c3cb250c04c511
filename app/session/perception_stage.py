"""Cameras -> frames -> particles, all the time."""

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import final

import anyio
import numpy as np

from app.core.announcer import MessageBus
from app.core.arm_pose_history import Following
from app.core.colours import ColourRange
from app.core.dialogue.requests import ColourRequest
from app.core.dialogue.segmentation_message import Seen
from app.core.dialogue.summary import Summary
from app.core.errors import DeviceError, DipacError, PerceptionError, UsageError, WorkerError
from app.core.messages import Frame, Particles, fresh_id
from app.core.ports import Camera, Clock, Computers, Rig
from app.core.system.channel import Latest
from app.core.system.worker import Worker
from app.perception.cloud.occlusion_memory import NOTHING
from app.perception.cloud.view_diagnostics import ViewDiagnostics
from app.perception.reconstruct import (
    PriorKnowledge,
    Reconstructed,
    Reconstruction,
    diagnose_views,
    reconstruct,
    warm_up,
)

_OBSERVE_DEADLINE_S = 30.0
_PERCEPTION_S = 120.0
"""A process that looks for longer hangs, and another is started; the first look loads it from a cold disk."""
_NICENESS = 5
"""Perception gives way to the event loop, which feeds the arm's watchdog, and goes before planning."""
_KEPT = 600
"""Particles of the past: those of two minutes, at five a second."""
_BEYOND_M = 1.0
"""Margin around the object's box: observations beyond it cannot be of an object."""


@final
class Seeing:
    """Holds `how` to reconstruct. What was begun before a change is of the former colours."""

    def __init__(self, how: Reconstruction) -> None:
        self.how = how

    def recolour(self, request: ColourRequest) -> str:
        """Look for these colours from now on; returns what was done, in words.

        Raises ParameterError where they make no range, and UsageError where no colours are looked for; nothing is
        changed then.
        """
        colour = ColourRange.of(request.hue_deg, request.saturation, request.value)
        if self.how.segmenter is not None:
            raise UsageError("A trained segmenter finds the object (--segmenter), whatever its colours.")
        self.how = replace(self.how, colour=colour)
        hue, saturation, value = colour.hue_deg, colour.saturation, colour.value
        return (
            f"{request.operator} set the object's colours: hue {hue[0]:.0f} to {hue[1]:.0f} degrees, saturation "
            f"{saturation[0]:.2f} to {saturation[1]:.2f}, value {value[0]:.2f} to {value[1]:.2f}."
        )


@final
class Sensing:
    """Perception stage. `frames`: of each camera; `particles`: of all together, reconstructed as `seeing` says."""

    def __init__(
        self,
        rig: Rig,
        how: Reconstruction,
        summary: Summary,
        announcer: MessageBus,
        clock: Clock,
        computers: Computers = Worker,
    ) -> None:
        self.seeing = Seeing(how)
        self.frames = {camera.model.name: Latest[Frame](f"frames {camera.model.name}") for camera in rig.cameras}
        self.particles = Latest[Particles]("particles")
        self.perceiver = computers("perception", niceness=_NICENESS, deadline_s=_PERCEPTION_S)
        self._rig, self._clock = rig, clock
        self._announcer, self._summary = announcer, summary
        self._past = deque[tuple[float, Particles]](maxlen=_KEPT)
        self._following = Following(rig.seen_arm, clock)
        self._memory, self._remembered_s, self._before = NOTHING, clock.now(), tuple[Frame, ...]()
        self._hid = self._gave_up = False

    async def run(self) -> None:
        """Look and reconstruct, for ever."""
        async with anyio.create_task_group() as stages:
            for camera in self._rig.cameras:
                stages.start_soon(self._capture, camera)
            stages.start_soon(self._following.run)
            stages.start_soon(self._reconstruct)

    async def next_particles(self, *, due_s: float) -> Particles:
        """The first particles whose every frame was taken at `due_s` [s] or later. Raises DeviceError without any."""
        with self._clock.move_on_after(_OBSERVE_DEADLINE_S):
            async for particles in self.particles.changes():
                if particles.time_s >= due_s:
                    return particles
        raise DeviceError(
            f"The object has not been seen for {_OBSERVE_DEADLINE_S:.0f} s; look at the camera images in the console, "
            "uncover the object, and start again."
        )

    def before(self, time_s: float) -> Particles | None:
        """The last particles whose frames were taken before `time_s` [s]; None where that is too long ago."""
        return next((seen for newest_s, seen in reversed(self._past) if newest_s < time_s), None)

    def between(self, first_s: float, last_s: float) -> list[Particles]:
        """Observations between two times, as far as they are kept."""
        return [seen for _, seen in self._past if first_s < seen.time_s < last_s]

    def recolour(self, request: ColourRequest) -> None:
        """Use other colours, if they make a range; the outcome has been announced."""
        try:
            self._announcer.notice("colours", self.seeing.recolour(request), request.id)
            self._memory = NOTHING
        except DipacError as error:
            self._announcer.notice("colours", str(error), request.id)

    async def _capture(self, camera: Camera) -> None:
        """Camera -> frames; a camera that fails is reported and tried again."""
        while True:
            try:
                frame = require_placed(await camera.read())
            except DeviceError as error:
                self._announcer.fault(f"camera {camera.model.name}", error)
                await self._clock.sleep(1.0)
                continue
            self.frames[camera.model.name].put(frame)
            self._announcer.say(frame)

    async def _reconstruct(self) -> None:
        """One new frame of every camera -> particles."""
        changes = [channel.changes() for channel in self.frames.values()]
        with suppress(WorkerError):  # The next call starts it anew, and says what is wrong with it.
            await self.perceiver.run(warm_up)  # Starts the process, too.
        while True:
            frames = [await anext(change) for change in changes]
            started_s = self._clock.now()
            try:
                found = await self._reconstruct_object(frames)
            except (PerceptionError, WorkerError) as error:
                self._announcer.fault("perception", error)
                continue
            now_s = self._clock.now()
            particles = Particles(
                id=fresh_id("particles"),
                cause=tuple(frame.id for frame in frames),
                time_s=min(frame.time_s for frame in frames),
                positions=found.positions,
                surface=found.surface,
                reconstruction_s=now_s - started_s,
                predicted=found.predicted,
            )
            self._summary.reconstruction_latency_s.append(now_s - _newest_s(frames))
            self._past.append((_newest_s(frames), particles))
            self.particles.put(self._announcer.say(particles))

    async def _reconstruct_object(self, frames: list[Frame]) -> Reconstructed:
        """Reconstruct the object, and publish the contents of each view, even if they are too little.

        Raises PerceptionError then.
        """
        how, known = self.seeing.how, self._prior_knowledge(frames)
        self._before = tuple(frames)
        try:
            found = credible(await self.perceiver.run(reconstruct, frames, how, self._rig.seen_arm.tool(), known), how)
            self._remembered_s = _newest_s(frames)
        except PerceptionError:
            looks = await self.perceiver.run(diagnose_views, frames, how, known)
            self._announcer.say(segmentation_message(frames, looks, how, now_s=self._clock.now()))
            raise
        self._announcer.say(segmentation_message(frames, found.looks, how, now_s=self._clock.now()))
        self._remember(found, how)
        return found

    def _prior_knowledge(self, frames: list[Frame]) -> PriorKnowledge:
        """Prior knowledge for these frames: the arm's pose at each of them, and earlier observations."""
        return PriorKnowledge(
            arm=self._rig.shape,
            postures=tuple(self._following.at(frame.time_s) for frame in frames),
            memory=self._memory,
            before=self._before,
            way=self._following.way(self._remembered_s, _newest_s(frames)),
        )

    def _remember(self, found: Reconstructed, how: Reconstruction) -> None:
        """Keep the memory for the next frames. Loss of an occluded part is announced once."""
        self._memory, hides = found.memory, bool(found.predicted.any())
        if hides and not self._hid:
            self._gave_up = False
        if found.expired and not self._gave_up:
            self._announcer.notice("perception", lost_part_notice(how))
            self._gave_up = True
        self._hid = hides


def _newest_s(frames: Sequence[Frame]) -> float:
    return max(frame.time_s for frame in frames)


def lost_part_notice(how: Reconstruction) -> str:
    """Text of the notice that a part of the object has been hidden for too long."""
    return (
        f"A part of the object has been hidden from all cameras for {how.hidden_s:.0f} s; nobody knows whether it is "
        "still where it was, and it is no longer shown. Move the arm, or what else is in front of it, aside."
    )


def require_placed(frame: Frame) -> Frame:
    """The frame, where its camera stands somewhere. Raises DeviceError where its calibration holds no numbers."""
    camera = frame.camera
    if not (np.isfinite(camera.K).all() and np.isfinite(camera.T_world_camera).all()):
        raise DeviceError(
            f"Nobody knows where camera {camera.name!r} stands: its calibration holds numbers that are not finite; "
            "calibrate it again (`dipac calibration`)."
        )
    return frame


def credible(found: Reconstructed, how: Reconstruction) -> Reconstructed:
    """The reconstruction, if it can be an object. Raises PerceptionError otherwise."""
    x, count = found.positions, how.particle_count
    low, high = np.asarray(how.box.low) - _BEYOND_M, np.asarray(how.box.high) + _BEYOND_M
    if len(x) == count and bool(np.all((x >= low) & (x <= high))):  # No number is no place either.
        return found
    what = f"{len(x)} particles instead of {count}" if len(x) != count else "particles that are nowhere near the table"
    raise PerceptionError(
        f"Perception found {what}; look at the camera images in the console, and start again if this goes on."
    )


def segmentation_message(
    frames: Sequence[Frame], looks: Sequence[ViewDiagnostics], how: Reconstruction, *, now_s: float
) -> Seen:
    """Message about the frames as segmented with these settings."""
    return Seen(
        id=fresh_id("seen"),
        cause=tuple(frame.id for frame in frames),
        time_s=now_s,
        masks={look.camera: look.mask for look in looks},
        pixels={look.camera: look.pixels for look in looks},
        points={look.camera: look.points for look in looks},
        hue_deg=how.colour.hue_deg,
        saturation=how.colour.saturation,
        value=how.colour.value,
        apart_m={look.camera: look.apart_m for look in looks if np.isfinite(look.apart_m)},
    )
