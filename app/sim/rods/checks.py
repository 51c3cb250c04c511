"""Checks of a rod's input: by candidate, step, place and value, before it costs anything, on the host."""

from dataclasses import dataclass
from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32

from app.core.errors import ParameterError
from app.sim.effects.base import Effect
from app.sim.model.params import require_ranges, rod_parameters_of
from app.sim.parameter import ParameterSpec
from app.sim.rods.domain import ROOM_M, STRAIN, distances_m, gap_m, strains, strides_m
from app.sim.rods.effect import RodSetting
from app.sim.rods.rollout import RodPhysics
from app.sim.rods.scene import RodScene
from app.sim.rods.state import STATE, RodState
from app.sim.runtime.checks import Arrays, first, require_finite, words

ROWS = ("x", "y", "x velocity", "y velocity", "x bristle", "y bristle", "finger's bristle", "lasting bend")
"""Names of the rows of `RodState.nodes`."""
_ABOVE_ZERO = ("rigidity", "mass", "creep")
_SIGNED = ("rest_curvature", "margin", "finger_yaw")


@final
@dataclass(frozen=True, kw_only=True)
class RodSetup:
    """Scene and effects that a rod's simulator is made for."""

    scene: RodScene
    effects: tuple[Effect, ...]

    def specs(self) -> tuple[ParameterSpec, ...]:
        """Specifications of the columns of phi."""
        return rod_parameters_of(self.effects)


def require_rod_shapes(
    setup: RodSetup, physics: RodPhysics, phi: Arrays, state: RodState, tool: Arrays, setting: RodSetting
) -> None:
    """Raises ParameterError where the arrays do not fit each other or the simulator."""
    count, nodes = tool.shape[0] if tool.ndim else 0, setup.scene.nodes
    particles = state.place.shape[1] if state.place.ndim == 2 else 0
    steps = max(2, tool.shape[1] if tool.ndim == 3 else 0)
    expected = {
        **{f"physics.{name}": (getattr(physics, name).shape, (count,)) for name in RodPhysics._fields},
        "phi": (phi.shape, (count, len(setup.specs()))),
        "state.nodes": (state.nodes.shape, (count, STATE, nodes)),
        "state.place": (state.place.shape, (count, particles)),
        "state.offset": (state.offset.shape, (count, particles, 3)),
        "tool": (tool.shape, (count, steps, 3)),
        "setting.material_coordinates": (setting.material_coordinates.shape, (count, nodes)),
        "setting.session_time": (setting.session_time.shape, (count,)),
    }
    for name, (given, wanted) in expected.items():
        if tuple(given) != wanted:
            raise ParameterError(f"{name} has shape {tuple(given)}; this simulator takes {wanted}.")


def require_rod_inputs(
    setup: RodSetup, physics: RodPhysics, phi: Arrays, state: RodState, tool: Arrays, setting: RodSetting
) -> None:
    """Raises ParameterError for the first number that no simulation can begin with, and says which it is and where.

    What `domain.is_in_domain` makes NaN at the start is refused, and besides what no rope is, one that is stiffer than
    the scene's time steps bear, and a finger that begins in it.
    """
    require_rod_shapes(setup, physics, phi, state, tool, setting)
    _require_all_finite(setup, physics, phi, state, tool, setting)
    if setup.effects:
        require_ranges(setup.specs(), np.asarray(phi, np.float32))
    _require_physics(setup.scene, physics)
    nodes, path = np.asarray(state.nodes, np.float32), np.asarray(tool, np.float32)
    _require_room(np.moveaxis(nodes[:, :2], 1, 2), "Node {1} of candidate {0}")
    _require_room(path, "The finger of candidate {0}, at path point {1},")
    _require_rest_lengths(setup.scene, nodes)
    _require_beside(setup.scene, nodes, path, np.asarray(physics.finger_half_m, np.float32))
    _require_slow(setup.scene, path)


def _require_all_finite(
    setup: RodSetup, physics: RodPhysics, phi: Arrays, state: RodState, tool: Arrays, setting: RodSetting
) -> None:
    require_finite("physics", np.stack([np.asarray(each) for each in physics], axis=1), "", RodPhysics._fields)
    require_finite("phi", phi, "", [spec.name for spec in setup.specs()])
    require_finite("state.nodes", np.moveaxis(np.asarray(state.nodes), 1, 2), "node", ROWS)
    require_finite("state.place", np.asarray(state.place)[..., None], "particle", ("place",))
    require_finite("state.offset", state.offset, "particle", ("forward", "left", "up"))
    require_finite("tool", tool, "path point", "xyz")
    require_finite("setting.material_coordinates", np.asarray(setting.material_coordinates)[..., None], "node", ("s",))
    require_finite("setting.session_time", np.asarray(setting.session_time)[:, None], "", ("time",))


def _require_physics(scene: RodScene, physics: RodPhysics) -> None:
    most = {
        "rigidity": (
            scene.max_rigidity_n_m2,
            f"the simulator bears {scene.max_rigidity_n_m2:g} N m^2 at most; raise the scene's stiffest_n_m2",
        ),
        "permanent_set": (1.0, "it is a share of bends, 1 at most"),
    }
    for name in RodPhysics._fields:
        values = np.asarray(getattr(physics, name), np.float32)
        low = np.float32(np.finfo(np.float32).tiny if name in _ABOVE_ZERO else 0.0)
        if name not in _SIGNED and (wrong := first(values < low)):
            least = "above 0" if name in _ABOVE_ZERO else "at least 0"
            raise ParameterError(f"physics.{name} of candidate {wrong[0]} is {values[wrong]:g}; it must be {least}.")
        high, why = most.get(name, (np.inf, ""))
        if wrong := first(values > np.float32(high)):
            raise ParameterError(f"physics.{name} of candidate {wrong[0]} is {values[wrong]:g}, and {why}.")


def _require_room(places: Float32[np.ndarray, "B K C"], whose: str) -> None:
    if wrong := first(np.abs(places).max(-1) > ROOM_M):
        raise ParameterError(
            f"{whose.format(*wrong)} is at {words(places[wrong])} m, farther than {ROOM_M:g} m from the origin; bring "
            "the table's frame nearer, or mend the place."
        )


def _require_rest_lengths(scene: RodScene, nodes: Float32[np.ndarray, "B 8 n"]) -> None:
    share = np.asarray(strains(scene.rest_m, jnp.asarray(nodes)))
    if wrong := first(np.abs(share) > np.float32(STRAIN)):
        b, j = wrong
        raise ParameterError(
            f"Segment {j} of candidate {b}, at {words(nodes[b, :2, j])} m, is {100 * share[wrong]:+.3g} % longer than "
            f"the {scene.rest_m:.4g} m that it has at rest; begin with `RodState.at_rest`, or with equal segments."
        )


def _require_beside(
    scene: RodScene,
    nodes: Float32[np.ndarray, "B 8 n"],
    tool: Float32[np.ndarray, "B T 3"],
    half: Float32[np.ndarray, "B 2"],
) -> None:
    gap = np.asarray(gap_m(scene.radius_m, *map(jnp.asarray, (nodes, tool[:, 0], half))))
    if wrong := first(gap < np.float32(scene.radius_m)):
        (b,) = wrong
        one = (nodes[b : b + 1, :2], tool[b : b + 1, 0, :2], half[b : b + 1])
        j = int(np.argmin(distances_m(*map(jnp.asarray, one))))
        raise ParameterError(
            f"The finger of candidate {b} begins at {words(tool[b, 0])} m, inside the rope: {1e3 * gap[b]:.3g} mm from "
            f"the middle of its segment {j}, whose radius is {1e3 * scene.radius_m:.3g} mm; begin beside it, or check "
            "where cameras and tool see the table."
        )


def _require_slow(scene: RodScene, tool: Float32[np.ndarray, "B T 3"]) -> None:
    stride = np.asarray(strides_m(scene.radius_m, jnp.asarray(tool)))
    if wrong := first(stride > np.float32(scene.radius_m)):
        b, s = wrong
        raise ParameterError(
            f"The finger of candidate {b} goes from {words(tool[b, s])} to {words(tool[b, s + 1])} m in step {s}, "
            f"{stride[wrong] / scene.dt_s:.3g} m/s: it would pass through a rope whose radius is {scene.radius_m:g} m; "
            "make the path of smaller steps."
        )


def out_of_domain(nodes: Float32[np.ndarray, "B 8 n"]) -> Bool[np.ndarray, "B n"]:
    """Nodes that are beyond the room."""
    return np.abs(nodes[:, :2]).max(1) > ROOM_M
