"""Particle cloud as small spheres that share one mesh."""

from typing import final

import numpy as np
import trimesh
import viser
from jaxtyping import Bool, UInt8

from app.core.types import Points
from app.ui.parts import palette

_RADIUS_M = 0.006
_CROWD = 600
"""Number of particles from which the beads shrink, so that a crowd still shows its shape."""


@final
class ParticleView:
    """One cloud of particles under `name`; made at the first `put`, since viser has no empty batch."""

    def __init__(self, server: viser.ViserServer, name: str, colour: palette.Colour, *, opacity: float | None) -> None:
        self._scene = server.scene
        self._name = name
        self._colour = colour
        self._opacity = opacity
        self._visible = True
        self._handle: viser.BatchedMeshHandle | None = None

    def put(self, positions: Points, shaded: Bool[np.ndarray, " P"] | None = None) -> None:
        """Show the particles `positions (N, 3)`, some of them `shaded`; N may change from call to call."""
        count, colours = len(positions), self._colours(len(positions), shaded)
        if self._handle is not None and len(self._handle.batched_positions) == count:
            self._handle.batched_positions = positions
            if not np.array_equal(colours, self._handle.batched_colors):
                self._handle.batched_colors = colours
            return
        if self._handle is not None:
            self._handle.remove()
        ball = trimesh.creation.icosphere(subdivisions=1, radius=_RADIUS_M * min(1.0, (_CROWD / count) ** (1 / 3)))
        self._handle = self._scene.add_batched_meshes_simple(
            self._name,
            vertices=np.asarray(ball.vertices),
            faces=np.asarray(ball.faces),
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            batched_positions=positions,
            batched_colors=colours,
            opacity=self._opacity,
            lod="off",
            cast_shadow=self._opacity is None,
            visible=self._visible,
        )

    def _colours(self, count: int, shaded: Bool[np.ndarray, " P"] | None) -> UInt8[np.ndarray, "N 3"]:
        """Colours of the particles."""
        colours = np.tile(palette.linear(self._colour), (count, 1))
        if shaded is not None and len(shaded) == count:
            colours[shaded] = palette.linear(palette.UNSEEN)
        return colours

    def clear(self) -> None:
        """Remove the beads until the next `put`."""
        if self._handle is not None:
            self._handle.remove()
            self._handle = None

    def show(self, visible: bool) -> None:
        """Draw or hide them."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible
