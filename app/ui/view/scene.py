"""The three-dimensional picture: table, particles, goal, plan, tool and cameras, redrawn where they changed."""

from typing import final

import numpy as np
import viser
from jaxtyping import Bool
from viser import transforms

from app.config import KeepOut, Limits, Workspace
from app.core.geometry.scene_description import Stage
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.messages import Frame
from app.core.types import Points
from app.ui.parts import palette
from app.ui.parts.console_state import ConsoleState
from app.ui.view.fixtures import draw_fixtures
from app.ui.view.particle_cloud import ParticleView
from app.ui.view.paths import Paths, along
from app.ui.view.tool import DrawnTool, Flat

_FRUSTUM_M = 0.035


@final
class ConsoleScene:
    """Everything drawn on the table of one server. Used by the painter's thread alone."""

    def __init__(
        self, server: viser.ViserServer, limits: Limits, table: TablePlace = AT_BASE, stage: Stage | None = None
    ) -> None:
        held = stage.tool if stage else None
        self._scene = server.scene
        self._last = ConsoleState()
        self._frustums: dict[str, viser.CameraFrustumHandle] = {}
        self.observed = ParticleView(server, "/observed", palette.OBSERVED, opacity=None)
        self.goal = ParticleView(server, "/goal", palette.GOAL, opacity=0.45)
        self.predicted = ParticleView(server, "/predicted", palette.PREDICTED, opacity=0.45)
        self.horizon = ParticleView(server, "/horizon", palette.HORIZON, opacity=0.3)
        self.horizon.show(False)
        self.expected = ParticleView(server, "/expected", palette.EXPECTED, opacity=0.6)
        self.paths = Paths(server)
        self.tool = DrawnTool(server, "/tool", palette.STEEL, opacity=None, tool=held)
        self.ghost = DrawnTool(server, "/ghost", palette.BEST, opacity=0.55, tool=held)
        self.playing = True
        """True while the ghost makes the pending motion; False while another ghost shows a moment of it."""
        _furnish(server, limits.workspace, table)
        draw_fixtures(server, stage.fixtures if stage else ())
        for number, volume in enumerate(limits.keep_out):
            _forbid(server, f"/kept_free/{number}", volume)

    def paint(self, state: ConsoleState, now_s: float) -> None:
        """Update the picture to the state."""
        last, self._last = self._last, state
        if state.particles is not last.particles:
            seen = state.particles
            _follow(self.observed, seen and seen.positions, seen and seen.predicted)
        if state.goal is not last.goal:
            _follow(self.goal, state.goal and state.goal.positions)
        if state.shown is not last.shown:
            _follow(self.horizon, state.shown and state.shown.chosen.final)
        if state.ahead is not last.ahead:
            _follow(self.predicted, state.ahead)
        if state.expected is not last.expected:
            _follow(self.expected, state.expected)
        if state.episode is not last.episode:
            flat = Flat.of(state.episode.task) if state.episode else None
            for tool in (self.tool, self.ghost):
                tool.become(flat)
        if state.arm is None:
            self.tool.hide()
        elif state.arm is not last.arm:
            self.tool.put(state.arm.pose, state.arm.gripper)
        self.paths.paint(state, last)
        self._play(state, now_s)

    def look(self, frame: Frame, picture: np.ndarray) -> None:
        """Show a camera at its pose, with its picture."""
        camera = frame.camera
        if camera.name not in self._frustums:
            pose = transforms.SE3.from_matrix(camera.T_world_camera)
            self._frustums[camera.name] = self._scene.add_camera_frustum(
                f"/cameras/{camera.name}",
                fov=2 * float(np.arctan2(camera.height / 2, camera.K[1, 1])),
                aspect=camera.width / camera.height,
                scale=_FRUSTUM_M,
                thickness=1.5,
                thickness_units="screen",
                color=palette.OUTLINE,
                image=picture,
                wxyz=pose.rotation().wxyz,
                position=pose.translation(),
                cast_shadow=False,
            )
        else:
            self._frustums[camera.name].image = picture

    def show_cameras(self, visible: bool) -> None:
        """Draw or hide the cameras."""
        for frustum in self._frustums.values():
            frustum.visible = visible

    def _play(self, state: ConsoleState, now_s: float) -> None:
        """Animate the ghost along the pending motion, at the arm's speed, in a loop."""
        if state.pending is None or not self.playing:
            self.ghost.hide()
            return
        self.ghost.put(along(state.pending.motion, now_s - state.pending.time_s), 1.0)


def _follow(beads: ParticleView, points: Points | None, shaded: Bool[np.ndarray, " P"] | None = None) -> None:
    """Draw the points, some of them shaded; remove them where there are none."""
    if points is None:
        beads.clear()
    else:
        beads.put(points, shaded)


def _furnish(server: viser.ViserServer, workspace: Workspace, table: TablePlace) -> None:
    """Table, workspace outline, the robot's base, light and the first view."""
    low, high = np.array(workspace.low), np.array(workspace.high)
    middle, extent = (low + high) / 2, high - low
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    scene.add_light_hemisphere("/light/sky", sky_color=(255, 255, 255), ground_color=(150, 150, 160), intensity=1.6)
    scene.add_light_directional("/light/lamp", intensity=1.8, cast_shadow=True, position=(0.2, -0.5, 1.5))
    scene.add_box(
        "/table",
        color=palette.TABLE,
        dimensions=(extent[0] + 0.5, extent[1] + 0.3, 0.02),
        position=(middle[0] - 0.1, middle[1], -0.0105),
        cast_shadow=False,
    )
    scene.add_grid(
        "/table/grid",
        width=extent[0],
        height=extent[1],
        cell_size=0.05,
        section_size=0.1,
        cell_color=(100, 107, 118),
        section_color=(116, 124, 136),
        plane_opacity=0.0,
        position=(0.1, 0.0, 0.0115),
    )
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    ring = np.column_stack([corners, np.full(4, 0.002)])
    scene.add_line_segments(
        "/workspace",
        np.stack([ring, np.roll(ring, -1, axis=0)], axis=1),
        palette.OUTLINE,
        thickness=2.0,
        thickness_units="screen",
    )
    base, half = table.table_from_base, np.radians(table.turn_deg) / 2
    turn = (float(np.cos(half)), 0.0, 0.0, -float(np.sin(half)))
    scene.add_frame("/base", show_axes=False, position=base[:3, 3], wxyz=turn)
    scene.add_cylinder("/base/foot", radius=0.06, height=0.08, color=(70, 76, 86), position=(0.0, 0.0, 0.04))
    scene.add_frame("/base/axes", axes_length=0.1, axes_radius=0.004, position=(0.0, 0.0, 0.05))
    server.initial_camera.position = (middle[0] + 0.75, middle[1] - 0.12, 0.66)
    server.initial_camera.look_at = (middle[0] - 0.02, middle[1], 0.0)


def _forbid(server: viser.ViserServer, name: str, volume: KeepOut) -> None:
    """Draw a keep-out volume, with its name above it."""
    low, high = np.array(volume.low), np.array(volume.high)
    sizes, middle = tuple(high - low), tuple((low + high) / 2)
    server.scene.add_box(
        name, color=palette.FORBIDDEN, dimensions=sizes, position=middle, opacity=0.3, cast_shadow=False
    )
    server.scene.add_label(f"{name}/name", volume.name, position=(0.0, 0.0, sizes[2] / 2 + 0.02))
