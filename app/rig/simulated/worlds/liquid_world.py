"""A liquid, pieces in it, and a bowl that pours it into a fixed one: our own engine, as MuJoCo has no liquids.

The planner's model is the same method, so this world is not another engine. It differs in its numerics: half the
spacing of particles and half the cells, so that flow thins and turns where the model's cannot; time steps of its own,
stiffer water, narrower contacts and less damping. It does not show errors that both share. An effect that is hidden in
it is the simulator's own term of that name, with the hidden values.
"""

from functools import lru_cache
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.errors import SimulationError
from app.core.geometry.bowls import centre_of_bowl
from app.core.geometry.scene_description import Liquid, Pieces, Soup, Stage
from app.core.geometry.shapes.fixtures import Bowl, Mat, Obstacle
from app.core.geometry.shapes.tools import HeldBowl
from app.core.motion import pointing_down
from app.core.types import ToolPose
from app.rig.simulated.worlds.arm_model import solve_joints
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import LIQUID_WORLD, WorldPhysics
from app.rig.simulated.worlds.sleep_detection import Rest
from app.rig.simulated.worlds.world import Nodes, Snapshot
from app.sim.effects.base import Effect
from app.sim.materials.elastic import Elastic
from app.sim.materials.liquid import LiquidMaterial
from app.sim.model.params import acting, columns_of, phi_with_nulls
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import State
from app.sim.tools.base import Tool
from app.sim.tools.bowl import BowlCollider
from app.sim.tools.box import BoxCollider

CELL_M, DT_S = 0.0075, 4e-4
"""Cells and time step of a liquid of as many drops as usual; of fewer, both are as much longer as their distances."""
_PERIOD_S = 0.01
"""A period of the arm, which is a whole number of time steps."""
_CHUNKS = (25, 5, 1)
"""Substeps simulated at a time, each number compiled once: a period of the arm is 25."""
_LOW_M, _HIGH_M, _CELLS_BELOW = (0.0525, -0.45), (1.0575, 0.45, 0.4275), 3
"""Box of the grid, so many cells of it below the table."""
_DAMPING_1_S = 0.2
_SPRAY = 3.0
"""Largest relative volume of a drop, at which a poured liquid's level fits its volume: see the material."""


@final
class LiquidWorld:
    """Particles (K, 3) of a liquid, initially at rest in an upright bowl about their centroid.

    `place` moves the bowl together with its content, undisturbed. The effects of `intrusion` act in it, the whole
    session alike.
    """

    def __init__(
        self,
        stage: Stage,
        start: Nodes,
        *,
        physics: WorldPhysics = LIQUID_WORLD,
        intrusion: Intrusion | None = None,
        time_s: float = 0.0,
    ) -> None:
        self.intrusion = intrusion or Intrusion(())
        physics = self.intrusion.physics(physics, stage.body)
        self._steps, self._start_s = 0, time_s
        body, held = stage.body, stage.tool
        if not (isinstance(body, Liquid | Soup) and isinstance(held, HeldBowl)):
            raise TypeError(f"A world of liquid has a held bowl, not a {type(held).__name__}.")
        self._held, self._rest = held, Rest()
        self._tool = pointing_down(centre_of_bowl(start, held.radius_m, body.volume_m3))
        scene, counts = _scene(stage, body, held, len(start), physics), particles(body, len(start))
        self._dt_s = scene.dt_s
        phi = phi_with_nulls(_terms(physics, self.intrusion))
        effects = acting(phi)
        self._simulate = _simulator(scene, counts, effects)
        self._phi = jnp.asarray(phi[None, columns_of(effects)], jnp.float32)
        self._state = State.at_rest(jnp.asarray(start[None], jnp.float32))

    @property
    def time_s(self) -> float:
        """The world's own time [s]."""
        return self._start_s + self._steps * self._dt_s

    @property
    def period_s(self) -> float:
        """Its time step [s]."""
        return self._dt_s

    @property
    def tool(self) -> ToolPose:
        """Pose of the bowl."""
        return self._tool.copy()

    def step(self, tool: ToolPose, duration_s: float) -> None:
        """Move the bowl in a straight line, turning evenly, while `duration_s` passes (whole substeps, at least 1).

        Raises SimulationError where the liquid's state becomes non-finite.
        """
        begin, end = self._tool, _same_sided(tool, self._tool)
        substeps, done = max(1, round(duration_s / self._dt_s)), 0
        self._steps += substeps
        self._tool = np.array(tool, np.float64)
        if self._rest.lasts(begin, end):
            return
        before = self.nodes()
        for chunk in _CHUNKS:
            while substeps - done >= chunk:
                share = (done + np.arange(chunk + 1)) / substeps
                path = bowl_coordinates(begin + share[:, None] * (end - begin))
                self._state = self._simulate(self._phi, self._state, jnp.asarray(path[None], jnp.float32))
                done += chunk
        after = self.nodes()
        if not np.isfinite(after).all():
            raise SimulationError(
                f"The simulated liquid broke {self.time_s:.2f} s into the episode: its numbers are not finite. Liquid "
                "that falls fast on the table may do that; pour lower or slower, or begin from another seed."
            )
        self._rest.watch(before, after, substeps * self._dt_s)

    def place(self, tool: ToolPose) -> None:
        """Move the bowl to `tool` with its content; no time passes."""
        x = self.nodes()
        inside = self.is_held(x)
        before, after = (Rotation.from_quat(pose[3:7], scalar_first=True) for pose in (self._tool, tool))
        x[inside] = (after * before.inv()).apply(x[inside] - self._tool[:3]) + tool[:3]
        self._state = self._state._replace(x=jnp.asarray(x[None], jnp.float32))
        self._tool = np.array(tool, np.float64)

    def is_held(self, x: Nodes) -> np.ndarray:
        """Mask of the points in the held bowl's ball."""
        return np.linalg.norm(x - self._tool[:3], axis=1) < self._held.radius_m + self._held.thickness_m

    def nodes(self) -> Nodes:
        """The particles [m]."""
        return np.asarray(self._state.x[0], np.float64)

    def snapshot(self) -> Snapshot:
        """The state to draw, with the arm's joints solved for the present tool pose."""
        return Snapshot(time_s=self.time_s, nodes=self.nodes(), tool=self.tool, joints=solve_joints(self._tool))


@lru_cache(maxsize=4)
def _simulator(scene: Scene, counts: tuple[int, ...], effects: tuple[Effect, ...]) -> Simulate:
    """The compiled world, which those of one session share."""
    return jax.jit(make_rollout(scene, particle_count=counts, effects=effects))


def _terms(physics: WorldPhysics, intrusion: Intrusion) -> dict[str, float]:
    """Values of the simulator's parameters by name."""
    own = {"stiffness": physics.bulk_pa, "table_friction": physics.table_friction}
    rough = {"finger_friction": physics.finger_friction}
    return own | rough | intrusion.terms()


def bowl_coordinates(poses: Float64[np.ndarray, "T 8"]) -> Float64[np.ndarray, "T 7"]:
    """Coordinates of the simulator's bowl: position and unit quaternion w x y z of its rotation from upright."""
    w, x, y, z = poses[:, 3:7].T
    # The quaternion times the conjugate of (0, 1, 0, 0), which points down.
    turn = np.stack([x, -w, -z, y], axis=1)
    return np.concatenate([poses[:, :3], turn / np.linalg.norm(turn, axis=1, keepdims=True)], axis=1)


def particles(body: Liquid | Soup, count: int) -> tuple[int, ...]:
    """Number of nodes, of `count`, of the liquid and of each kind of piece."""
    solid = [kind.grains for kind in body.pieces] if isinstance(body, Soup) else []
    return (count - sum(solid), *solid)


def _scene(stage: Stage, body: Liquid | Soup, held: HeldBowl, count: int, physics: WorldPhysics) -> Scene:
    spacing = (body.volume_m3 / count) ** (1 / 3)
    tools: list[Tool] = [BowlCollider.that_pours(held)]
    for each in stage.fixtures:
        match each:
            case Bowl():
                tools.append(BowlCollider.that_stands(each))
            case Obstacle():
                tools.append(BoxCollider(half_m=each.half_m, place_m=each.place_m, friction=each.friction))
            case Mat():
                pass
            case _:
                raise TypeError(f"The world of a liquid knows bowls and blocks, not a {type(each).__name__}.")
    apart = _apart(body)
    cell_m = CELL_M * apart
    return Scene(
        low=(*_LOW_M, -_CELLS_BELOW * cell_m),
        high=_HIGH_M,
        cell_m=cell_m,
        dt_s=_PERIOD_S / round(_PERIOD_S / (DT_S * apart)),
        damping_1_s=_DAMPING_1_S,
        contact_margin_m=0.5 * spacing,
        contact_width_m=0.0008,
        bodies=tuple(_bodies(body, physics.bulk_pa)),
        tools=tuple(tools),
    )


def _apart(body: Liquid | Soup) -> float:
    """Distance of its drops over that of as many as usual; a soup's are as its pieces' grains."""
    return float(np.cbrt(Liquid.drops / body.drops)) if isinstance(body, Liquid) else Pieces.along / body.along


def _bodies(body: Liquid | Soup, bulk_pa: float) -> list[Body]:
    """The liquid and then each kind of piece."""
    liquid = body.liquid if isinstance(body, Soup) else body
    bodies = [
        Body(volume_m3=liquid.volume_m3, density_kg_m3=liquid.density_kg_m3, material=LiquidMaterial(spray=_SPRAY))
    ]
    for kind in body.pieces if isinstance(body, Soup) else ():
        stiffness, density = kind.young_pa / bulk_pa, kind.density_kg_m3
        bodies.append(Body(volume_m3=kind.volume_m3, density_kg_m3=density, material=Elastic(), stiffness=stiffness))
    return bodies


def _same_sided(tool: ToolPose, before: ToolPose) -> ToolPose:
    """The pose with the sign of its quaternion nearer to the one before."""
    flipped = np.array(tool, np.float64)
    flipped[3:7] *= 1.0 if tool[3:7] @ before[3:7] >= 0 else -1.0
    return flipped
