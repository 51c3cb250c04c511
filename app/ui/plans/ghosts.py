"""Two branches in the scene: their paths, and the object and the gripper at a moment."""

from typing import final

import numpy as np
import viser

from app.core.messages import Branch
from app.ui.parts import palette
from app.ui.plans.look import PreviewState
from app.ui.view.particle_cloud import ParticleView
from app.ui.view.paths import segments
from app.ui.view.tool import DrawnTool, Flat

_THICK_PX = 5.0


@final
class Ghosts:
    """The two branches of one server's scene. Used by the painter's thread alone."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._looked = PlanPreview(server, "/look/at", palette.LOOKED)
        self._compared = PlanPreview(server, "/look/beside", palette.COMPARED)

    def become(self, flat: Flat | None) -> None:
        """Draw grippers as this flat finger, or as two fingers."""
        for ghost in (self._looked, self._compared):
            ghost.tool.become(flat)

    def paint(self, look: PreviewState | None) -> None:
        """Draw the chosen branches. The proposed path is drawn anyway; at moment now, the observed object is."""
        at = look.branch if look else None
        proposed = look is not None and look.at == look.proposal.best
        self._looked.paint(look, at, way=not proposed)
        self._compared.paint(look, look.other if look else None, way=True)


@final
class PlanPreview:
    """One branch under `name`."""

    def __init__(self, server: viser.ViserServer, name: str, colour: palette.Colour) -> None:
        self._way = Way(server, f"{name}/way", colour)
        self._beads = ParticleView(server, f"{name}/object", colour, opacity=0.5)
        self.tool = DrawnTool(server, f"{name}/tool", colour, opacity=0.5)

    def paint(self, look: PreviewState | None, branch: Branch | None, *, way: bool) -> None:
        """Draw `branch` at the moment of `look`, and its path where `way`."""
        self._way.put(branch.tool_path if branch and way else None)
        ghost = look.ghost(branch) if look and branch and look.share else None
        if ghost is None or not np.isfinite(ghost.particles).all():
            self._beads.clear()
            self.tool.hide()
            return
        self._beads.put(np.ascontiguousarray(ghost.particles))
        if np.isfinite(ghost.tool).all():
            self.tool.put(ghost.tool, 1.0)
        else:
            self.tool.hide()


@final
class Way:
    """A thick line under `name`, or none."""

    def __init__(self, server: viser.ViserServer, name: str, colour: palette.Colour) -> None:
        self._scene, self._name, self._colour = server.scene, name, np.array(colour)
        self._drawn: np.ndarray | None = None
        self._line: viser.LineSegmentsHandle | None = None

    def put(self, way: np.ndarray | None) -> None:
        """Draw the path (W, 3) [m], or nothing; sent only where it has changed."""
        if way is self._drawn:
            return
        self._drawn = way
        if self._line is not None:
            self._line.remove()
            self._line = None
        pieces = segments(way) if way is not None else np.zeros((0, 2, 3))
        if len(pieces):
            self._line = self._scene.add_line_segments(
                self._name, pieces, self._colour, thickness=_THICK_PX, thickness_units="screen"
            )
