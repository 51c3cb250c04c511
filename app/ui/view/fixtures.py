"""Fixtures on the table, as they are drawn in the scene."""

from collections.abc import Sequence
from typing import Final

import viser

from app.core.geometry.shapes.fixtures import Fixture
from app.ui.parts import palette

SEEN_THROUGH: Final = 0.35
"""Opacity of what may hold the object."""


def draw_fixtures(server: viser.ViserServer, fixtures: Sequence[Fixture]) -> None:
    """Draw them under `/fixtures`, where they stand in the world."""
    for number, fixture in enumerate(fixtures):
        mesh = fixture.mesh()
        server.scene.add_mesh_simple(
            *(f"/fixtures/{number}", mesh.vertices, mesh.faces),
            color=palette.of_light(fixture.colour),
            opacity=SEEN_THROUGH if fixture.is_hollow else None,
            side="double",
            cast_shadow=not fixture.is_hollow,
        )
