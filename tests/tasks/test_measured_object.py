"""Sizes and colours of objects, measured in images of them, with errors that hold."""

import numpy as np
import pytest

from app.core.colours import colour_mask
from app.core.errors import PerceptionError
from app.core.geometry.object_description import ObjectType
from app.core.messages import Frame, fresh_id
from app.jobs.measured_object import measure_colours, measure_object
from app.perception.mask.segment import ByColour
from app.perception.reconstruct import PriorKnowledge, reconstruct
from app.rig.simulated.cameras.cameras import table_cameras
from app.rig.simulated.cameras.render import render
from app.rig.simulated.kinds import kind_of
from app.tasks import load


def looked_at(name: str) -> tuple[list[np.ndarray], list[Frame]]:
    """Surfaces of the task's object as two cameras see it at rest, twice, and the last pictures."""
    task, rng = load(name), np.random.default_rng(0)
    world = kind_of(task.stage).build(task.stage, task.start(0), 0.0)
    world.step(world.tool, 0.3)
    shown, surfaces, frames = world.snapshot(), list[np.ndarray](), list[Frame]()
    for _ in range(2):
        pictures = [(camera, render(shown, camera, rng, stage=task.stage)) for camera in table_cameras()]
        frames = [
            Frame(id=fresh_id("frame"), time_s=0.0, camera=camera, color=color, depth=depth)
            for camera, (color, depth) in pictures
        ]
        surfaces.append(reconstruct(frames, task.reconstruction("cpu"), shown.tool, PriorKnowledge()).surface)
    return surfaces, frames


@pytest.mark.parametrize(
    ("name", "kind", "truth"),
    [
        ("rope_push", "rope", {"length_m": 0.40, "radius_m": 0.008}),
        ("rope_push(length_m=0.25,radius_m=0.005)", "rope", {"length_m": 0.25, "radius_m": 0.005}),
        ("bean_sweep", "beans", {"count": 50, "piece_length_m": 0.016, "piece_width_m": 0.010}),
        ("bean_sweep(count=30)", "beans", {"count": 30}),
        ("cloth_hang", "cloth", {"size_m": 0.25}),
        ("cloth_hang(size_m=0.2)", "cloth", {"size_m": 0.20}),
    ],
)
def test_what_cameras_see_of_an_object_says_how_large_it_is(
    name: str, kind: ObjectType, truth: dict[str, float]
) -> None:
    surfaces, frames = looked_at(name)
    found = {size.name: size for size in measure_object(kind, surfaces).sizes}
    for size, value in truth.items():
        assert abs(found[size].value - value) < 3 * found[size].sd, size
        assert found[size].sd < 0.2 * value, size
    task = load(name)
    colours = measure_colours([frame.color for frame in frames], task.perception.segmenting)
    assert colours is not None
    colour, seen = colours
    np.testing.assert_allclose(colour, task.stage.body.colour, atol=0.15)
    # By the colours that were seen, cameras find nearly the same pixels.
    for frame in frames:
        usual, own = (colour_mask(frame.color, each) for each in (task.perception.colour, seen))
        assert (usual & own).sum() > 0.9 * usual.sum()
        assert (own & ~usual).sum() < 0.05 * usual.sum()


def test_what_is_hardly_seen_is_not_measured() -> None:
    with pytest.raises(PerceptionError, match="look at the masks"):
        measure_object("rope", [np.zeros((5, 3), np.float32)])
    found = measure_object("liquid", [])
    assert not found.sizes
    assert "measure them" in found.notes[0]
    black = np.zeros((20, 20, 3), np.uint8)
    assert measure_colours([black], ByColour(ranges=(load("rope_push").perception.colour,))) is None
    assert measure_colours([], ByColour(ranges=(load("rope_push").perception.colour,))) is None


def test_a_cloth_that_is_folded_is_said_not_to_be_square() -> None:
    rng = np.random.default_rng(0)
    folded = np.column_stack([rng.uniform(0, 0.25, 4000), rng.uniform(0, 0.12, 4000), np.zeros(4000)])
    found = measure_object("cloth", [folded.astype(np.float32)])
    assert "lay it flat" in found.notes[-1]
    assert found.sizes[0].sd > 0.05
