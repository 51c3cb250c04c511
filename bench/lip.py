"""Water that a slowly tilted bowl keeps, beside what hydrostatics say: where it runs over a lip. See `--help`.

At rest no more is left than the cap of the sphere below its lip: pi h^2 (R - h / 3) of depth h = R (1 - sin tilt).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.scene_description import Liquid, Stage
from app.core.geometry.shapes.tools import HeldBowl
from app.core.types import Points
from app.jobs import jit_cache
from app.rig.simulated.worlds.liquid_world import LiquidWorld
from app.sim.model.params import acting, columns_of
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from app.sim.tools.bowl import BowlCollider
from app.tasks.elements.pouring import pool, pouring_scene
from app.tasks.pour_water import HELD, PARTICLES, TARGET, WATER
from bench.hidden.pours import DROPS

TILTS_RAD = tuple(np.arange(0.4, 1.41, 0.1).tolist())
BOWLS = ((0.055, 120e-6), (0.055, 60e-6), (0.055, 180e-6), (0.040, 50e-6), (0.075, 300e-6))
"""Inner radii [m] of bowls and the volume [m^3] of the water in them; the first are those of the task."""
_TURN_S, _REST_S = 0.5, 2.0
_MIDDLE_M = np.array([0.34, 0.0, 0.25])

Tilt = Callable[[float, float], float]
"""Turn the bowl from one tilt [rad] to the next, wait, and say which share of the liquid it still holds."""


def kept_at_rest(tilt_rad: float, radius_m: float, volume_m3: float) -> float:
    """Share of a liquid that a half sphere keeps, after hydrostatics."""
    depth = radius_m * (1 - np.sin(tilt_rad))
    return float(min(1.0, np.pi * depth**2 * (radius_m - depth / 3) / volume_m3))


def in_the_model(radius_m: float, volume_m3: float, *, lowered: bool) -> Tilt:
    """Water on a planner's cells; with the rim of a bowl that pours, or with that which it has."""
    held, water = HeldBowl(radius_m=radius_m, thickness_m=0.004), Liquid(volume_m3=volume_m3, colour=(0.1, 0.3, 0.8))
    scene = pouring_scene(water, held, TARGET, particle_count=PARTICLES)
    poured, filled = scene.tools
    assert isinstance(poured, BowlCollider)
    scene = replace(scene, tools=(poured if lowered else replace(poured, rim_m=0.0), filled))
    phi = jit_cache.phi_of(jit_cache.nominal_model("pour_water"))
    effects = acting(phi)
    simulate = jax.jit(make_rollout(scene, particle_count=(PARTICLES,), effects=effects))
    columns = jnp.asarray(phi[None, columns_of(effects)], jnp.float32)
    x = pool(_MIDDLE_M, radius_m, volume_m3=volume_m3, count=PARTICLES)
    state = State.at_rest(jnp.asarray(x[None]))

    def tilt(before_rad: float, after_rad: float) -> float:
        nonlocal state
        turn, rest = round(_TURN_S / scene.dt_s), round(_REST_S / scene.dt_s)
        half = np.append(np.linspace(before_rad, after_rad, turn + 1), np.full(rest, after_rad)) / 2
        path = np.zeros((len(half), 7), np.float32)
        path[:, :3], path[:, 3], path[:, 5] = _MIDDLE_M, np.cos(half), np.sin(half)
        state = simulate(columns, state, jnp.asarray(path[None]))
        return _held(np.asarray(state.x[0]), _MIDDLE_M, held)

    return tilt


def in_the_world(*, drops: int = Liquid.drops) -> Tilt:
    """Water of the simulated cell, in the task's bowl."""
    start = pool(_MIDDLE_M, HELD.radius_m, volume_m3=WATER.volume_m3, count=drops).astype(np.float64)
    cell = LiquidWorld(Stage(body=replace(WATER, drops=drops), tool=HELD), start)
    upright = cell.tool

    def pose(angle_rad: float) -> Float64[np.ndarray, "8"]:
        turn = Rotation.from_rotvec([0.0, angle_rad, 0.0]) * Rotation.from_quat(upright[3:7], scalar_first=True)
        return np.array([*upright[:3], *turn.as_quat(scalar_first=True), 0.0])

    def tilt(before_rad: float, after_rad: float) -> float:
        for angle in np.linspace(before_rad, after_rad, 6)[1:]:
            cell.step(pose(angle), _TURN_S / 5)
        cell.step(cell.tool, _REST_S)
        return float(cell.is_held(cell.nodes()).mean())

    return tilt


def _held(x: Points, middle: Float64[np.ndarray, "3"], held: HeldBowl) -> float:
    return float((np.linalg.norm(x - middle, axis=1) < held.radius_m + held.thickness_m).mean())


def kept(tilt: Tilt, tilts_rad: Sequence[float] = TILTS_RAD) -> Float64[np.ndarray, " T"]:
    """Share that is left at each tilt, one after the other."""
    return np.array([tilt(before, after) for before, after in zip((0.0, *tilts_rad), tilts_rad, strict=False)])


def _line(name: str, shares: Float64[np.ndarray, " T"], rest: Float64[np.ndarray, " T"]) -> str:
    error = float(np.sqrt(np.mean((shares - rest) ** 2)))
    return f"{name:<38} {error:5.3f}  " + " ".join(f"{share:5.2f}" for share in shares)


def main(of: Literal["model", "world", "both"] = "both") -> None:
    """Shares that are kept at each tilt, and their RMS error by hydrostatics.

    Args:
        of: the planner's model in five bowls, a few seconds each; the cell's world, minutes; or both
    """
    print(f"{'':<38} {'RMS':>5}  " + " ".join(f"{tilt:5.1f}" for tilt in TILTS_RAD) + "  rad", flush=True)
    for radius_m, volume_m3 in BOWLS if of != "world" else BOWLS[:1]:
        rest = np.array([kept_at_rest(tilt, radius_m, volume_m3) for tilt in TILTS_RAD])
        name = f"{1e6 * volume_m3:.0f} ml in R = {1e3 * radius_m:.0f} mm"
        print(_line(f"{name}, hydrostatics", rest, rest), flush=True)
        if of != "world":
            for lowered in (False, True):
                rim = "that of a bowl that pours" if lowered else "its own rim"
                print(
                    _line(f"  model, {rim}", kept(in_the_model(radius_m, volume_m3, lowered=lowered)), rest), flush=True
                )
        if of != "model" and (radius_m, volume_m3) == BOWLS[0]:
            for drops in (Liquid.drops, DROPS):
                print(_line(f"  world, {drops} drops", kept(in_the_world(drops=drops)), rest), flush=True)


if __name__ == "__main__":
    tyro.cli(main)
