"""Fixtures on the table, and the bowl in the hand, as they are drawn in the scene."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import trimesh
import viser

from app.core.geometry.shapes import fixtures as shapes
from app.ui.parts import palette

BOWL_OPACITY: Final = 0.35
"""Bowls are seen through: what counts is in them."""
_MAT_M: Final = 0.001
_SECTIONS: Final = 48
_ARC: Final = 16
_ALONG_X: Final = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)
"""Quaternion w x y z that turns a cylinder's axis from z to x."""


def draw_fixtures(server: viser.ViserServer, fixtures: Sequence[shapes.Fixture]) -> None:
    """Draw them under `/fixtures`, where they stand in the world."""
    scene = server.scene
    for number, fixture in enumerate(fixtures):
        name, colour = f"/fixtures/{number}", palette.of_light(fixture.colour)
        match fixture:
            case shapes.Bowl():
                draw_bowl(scene, name, fixture.radius_m, fixture.thickness_m, colour).position = fixture.place_m
            case shapes.Obstacle():
                dimensions = (2 * fixture.half_m[0], 2 * fixture.half_m[1], 2 * fixture.half_m[2])
                scene.add_box(name, color=colour, dimensions=dimensions, position=fixture.place_m)
            case shapes.Mat():
                middle = (*fixture.place_m, _MAT_M / 2)
                scene.add_cylinder(name, fixture.radius_m, _MAT_M, colour, position=middle, cast_shadow=False)
            case shapes.Rack():
                for rod, (start, end) in enumerate(fixture.ends_m()):
                    middle, length_m = (np.array(start) + np.array(end)) / 2, end[0] - start[0]
                    scene.add_cylinder(
                        f"{name}/{rod}", fixture.radius_m, length_m, colour, position=middle, wxyz=_ALONG_X
                    )


def draw_bowl(
    scene: viser.SceneApi, name: str, radius_m: float, thickness_m: float, colour: palette.Colour
) -> viser.MeshHandle:
    """Half of a hollow sphere, open upwards, about the origin; `radius_m`: the inner one."""
    angles = np.linspace(-np.pi / 2, 0.0, _ARC)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    profile = np.concatenate([(radius_m + thickness_m) * arc, radius_m * arc[::-1]])
    shell = trimesh.creation.revolve(profile, sections=_SECTIONS)
    return scene.add_mesh_simple(
        *(name, np.asarray(shell.vertices), np.asarray(shell.faces)),
        color=colour,
        opacity=BOWL_OPACITY,
        side="double",
        cast_shadow=False,
    )
