"""Measurement of the object by cameras, for whoever describes it."""

from collections.abc import Iterator, Mapping
from typing import Final, final

from app.core.announcer import MessageBus
from app.core.colours import ColourRange
from app.core.dialogue.object_messages import MeasuredObject, MeasuredSize
from app.core.dialogue.requests import MeasureRequest
from app.core.errors import DipacError
from app.core.geometry.scene_description import Beans, Body, Cloth, Liquid, Rope
from app.core.geometry.shapes.base import Colour
from app.core.messages import fresh_id
from app.core.ports import Clock, Computers
from app.jobs.measured_object import measure_colours, measure_object
from app.session.perception_stage import Sensing
from app.tasks.elements.base import Task
from app.tasks.elements.descriptions import object_type

_PAST_S: Final = 5.0
"""Views of so long ago are measured."""


@final
class Measuring:
    """Measures the object in a process that is started for it."""

    def __init__(self, sensing: Sensing, announcer: MessageBus, clock: Clock, computers: Computers) -> None:
        self._sensing, self._announcer, self._clock, self._computers = sensing, announcer, clock, computers

    async def handle(self, request: MeasureRequest, task: Task) -> None:
        """Publish what is measured, or why nothing is."""
        kind, now_s = object_type(task), self._clock.now()
        if kind is None:
            text = f"The object of {task.problem} cannot be described; see docs/objects.md for those that can."
            self._announcer.notice("object", text, request.id)
            return
        views = self._sensing.between(now_s - _PAST_S, now_s)
        how = self._sensing.seeing.how
        frames = [channel.value for channel in self._sensing.frames.values()]
        images = [frame.color for frame in frames if frame is not None]
        try:
            worker = self._computers("measuring", niceness=10)
            async with worker:
                found = await worker.run(measure_object, kind, tuple(view.surface for view in views))
                seen = await worker.run(measure_colours, images, how.segmenting)
        except DipacError as error:
            self._announcer.notice("object", f"Nothing was measured. {error}", request.id)
            return
        self._announcer.say(
            MeasuredObject(
                id=fresh_id("measured"),
                cause=(request.id, *(view.id for view in views[-1:])),
                time_s=self._clock.now(),
                kind=kind,
                views=len(views),
                sizes=(*found.sizes, *_unseen(task.stage.body, {size.name: size.value for size in found.sizes})),
                notes=found.notes,
                **_colours(*seen) if seen else {},
            )
        )


def _colours(colour: Colour, colours: ColourRange) -> dict[str, tuple[float, ...]]:
    return {
        "colour": colour,
        "hue_deg": colours.hue_deg,
        "saturation": colours.saturation,
        "value": colours.value,
    }


def _unseen(own: Body, sizes: Mapping[str, float]) -> Iterator[MeasuredSize]:
    """Sizes that no camera sees: of an object of these sizes that is made of what the task's `own` is."""
    match own:
        case Rope():
            length, radius = (sizes.get(name, getattr(own, name)) for name in ("length_m", "radius_m"))
            share = (length / own.length_m) * (radius / own.radius_m) ** 2
            yield MeasuredSize(name="mass_kg", value=own.mass_kg * share, sd=0.0, seen=False)
        case Beans():
            share = sizes.get("count", own.count) / own.count
            yield MeasuredSize(name="mass_kg", value=own.mass_kg * share, sd=0.0, seen=False)
        case Cloth():
            share = (sizes.get("size_m", own.size_m) / own.size_m) ** 2
            yield MeasuredSize(name="mass_kg", value=own.mass_kg * share, sd=0.0, seen=False)
        case Liquid():
            yield MeasuredSize(name="volume_m3", value=own.volume_m3, sd=0.0, seen=False)
            yield MeasuredSize(name="density_kg_m3", value=own.density_kg_m3, sd=0.0, seen=False)
        case _:
            pass
